#include "zone/WallSolver.hpp"

#include <algorithm>
#include <cmath>

#include "zone/air.hpp"

namespace amiss::zone {
namespace {

// Of ordinary building materials (1e-7 to 1e-6 m2/s).
constexpr double reference_diffusivity = 5e-7;
constexpr double room_temperature = 293.15;

/// Cells of a layer: 3.5 sqrt(thickness / d), d the depth that heat diffuses within one interval. Thick
/// layers get fewer cells per depth than thin ones, because slow changes are all that reaches their middle.
/// Switched heating of 15-min intervals is then within 0.005 K of eight times as many cells.
int count_cells(double thickness, double interval, double cells) {
  const double depth = std::sqrt(reference_diffusivity * interval);
  return std::max(1, static_cast<int>(std::ceil(3.5 * cells * std::sqrt(thickness / depth))));
}

}  // namespace

WallSolver::WallSolver(const Wall& wall, double interval, double cells) {
  to_air_ = wall.area * wall.inside_convection;
  to_star_ = wall.area * wall.inside_emissivity * 4.0 * stefan_boltzmann * std::pow(room_temperature, 3);
  outside_conductance_ = wall.outside == no_column ? 0.0 : wall.area * wall.outside_film;
  for (const Layer& layer : wall.layers) add_layer(layer, wall.area, interval, cells);

  const auto n = static_cast<Eigen::Index>(cell_capacity_.size());
  capacity_ = Eigen::ArrayXd::Zero(n + 1);
  for (Eigen::Index j = 0; j < n; ++j) capacity_.segment(j, 2) += 0.5 * cell_capacity_[j];
  state_ = stage_ = base_ = rhs_ = inverse_pivot_ = Eigen::ArrayXd::Zero(n + 1);
  multiplier_ = Eigen::ArrayXd::Zero(n);
}

void WallSolver::add_layer(const Layer& layer, double area, double interval, double cells) {
  const int n = count_cells(layer.thickness, interval, cells);
  const double width = layer.thickness / n;
  cell_capacity_.insert(cell_capacity_.end(), n, area * width * layer.capacity);
  cell_conductance_.insert(cell_conductance_.end(), n, area * layer.conductivity / width);
}

void WallSolver::start_steady(double air, double outside) {
  state_.setConstant(air);
  if (outside_conductance_ == 0.0) return;
  double resistance = 1.0 / (to_air_ + to_star_) + 1.0 / outside_conductance_;
  for (double conductance : cell_conductance_) resistance += 1.0 / conductance;
  const double flux = (air - outside) / resistance;
  state_[0] = air - flux / (to_air_ + to_star_);
  for (std::size_t j = 0; j < cell_conductance_.size(); ++j) {
    state_[j + 1] = state_[j] - flux / cell_conductance_[j];
  }
}

void WallSolver::factorise(double weight, double outside_conductance) {
  weight_ = weight;
  outside_conductance_ = outside_conductance;
  const Eigen::Index n = multiplier_.size();
  double pivot = capacity_[n] + weight * (cell_conductance_[n - 1] + outside_conductance);
  inverse_pivot_[n] = 1.0 / pivot;
  for (Eigen::Index j = n - 1; j >= 0; --j) {
    const double across = weight * cell_conductance_[j];
    const double inwards = j > 0 ? cell_conductance_[j - 1] : to_air_ + to_star_;
    multiplier_[j] = across * inverse_pivot_[j + 1];
    pivot = capacity_[j] + weight * inwards + across - across * multiplier_[j];
    inverse_pivot_[j] = 1.0 / pivot;
  }
}

double WallSolver::eliminate(bool first, double inside, double outside) {
  const Eigen::Index n = multiplier_.size();
  rhs_ = capacity_ * (first ? state_ : base_);
  rhs_[0] += weight_ * inside;
  rhs_[n] += weight_ * outside;
  for (Eigen::Index j = n - 1; j >= 0; --j) rhs_[j] += multiplier_[j] * rhs_[j + 1];
  return rhs_[0] * inverse_pivot_[0];
}

double WallSolver::substitute(double from_room) {
  const Eigen::Index n = multiplier_.size();
  rhs_[0] += weight_ * from_room;
  stage_ = rhs_ * inverse_pivot_;
  for (Eigen::Index j = 0; j < n; ++j) stage_[j + 1] += multiplier_[j] * stage_[j];
  return stage_[n];
}

}  // namespace amiss::zone
