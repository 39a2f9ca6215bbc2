#include "zone/WallSolver.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "zone/air.hpp"

namespace amiss::zone {
namespace {

// Of ordinary building materials (1e-7 to 1e-6 m2/s).
constexpr double reference_diffusivity = 5e-7;
constexpr double room_temperature = 293.15;
constexpr double most_cells = 1e6;  // of a layer

/// Cells of a layer: 3.5 sqrt(thickness / d), d the depth that heat diffuses within one interval. Thick
/// layers get fewer cells per depth than thin ones, because slow changes are all that reaches their middle.
/// Switched heating of 15-min intervals is then within 0.005 K of eight times as many cells.
int count_cells(double thickness, double interval, double cells) {
  const double depth = std::sqrt(reference_diffusivity * interval);
  const double wanted = std::ceil(3.5 * cells * std::sqrt(thickness / depth));
  if (!(wanted <= most_cells)) {
    std::ostringstream message;
    message << "a wall's layer of " << thickness << " m needs more than 1e6 cells at cells = " << cells
            << " and intervals of " << interval << " s; the layer must be thinner or cells smaller";
    throw std::invalid_argument(message.str());
  }
  return std::max(1, static_cast<int>(wanted));
}

/// Conductance (W/K) and capacity (J/K) of each cell of a wall, from inside to outside.
struct Cells {
  std::vector<double> conductance, capacity;
};

Cells make_cells(const Wall& wall, double interval, double cells) {
  Cells out;
  for (const Layer& layer : wall.layers) {
    const int n = count_cells(layer.thickness, interval, cells);
    const double width = layer.thickness / n;
    out.capacity.insert(out.capacity.end(), n, wall.area * width * layer.capacity);
    out.conductance.insert(out.conductance.end(), n, wall.area * layer.conductivity / width);
  }
  return out;
}

}  // namespace

WallSolver::WallSolver(const std::vector<const Wall*>& walls, double interval, double cells) {
  std::vector<Cells> made;
  std::size_t most = 0;
  for (const Wall* wall : walls) {
    made.push_back(make_cells(*wall, interval, cells));
    most = std::max(most, made.back().capacity.size());
  }
  const auto nodes = static_cast<Eigen::Index>(most) + 1;
  capacity_ = cell_conductance_ = is_last_ = Nodes::Zero(kLanes, nodes);
  state_ = stage_ = base_ = rhs_ = inverse_pivot_ = multiplier_ = capacity_;
  for (std::size_t k = 0; k < walls.size(); ++k) {
    const Wall& wall = *walls[k];
    const auto lane = static_cast<Eigen::Index>(k);
    const auto n = static_cast<Eigen::Index>(made[k].capacity.size());
    to_air_[lane] = wall.area * wall.inside_convection;
    to_star_[lane] =
        wall.area * wall.inside_emissivity * 4.0 * stefan_boltzmann * std::pow(room_temperature, 3);
    if (wall.outside != no_column) outside_conductance_[lane] = wall.area * wall.outside_film;
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto cell = static_cast<std::size_t>(j);
      capacity_.row(lane).segment(j, 2) += 0.5 * made[k].capacity[cell];
      cell_conductance_(lane, j) = made[k].conductance[cell];
    }
    is_last_(lane, n) = 1.0;
  }
}

void WallSolver::start_steady(int lane, double air, double outside) {
  const auto conductance = cell_conductance_.row(lane);
  const bool adiabatic = outside_conductance_[lane] == 0.0;
  const double film = to_air_[lane] + to_star_[lane];
  Eigen::Index last = 0;
  double resistance = adiabatic ? 1.0 : 1.0 / film + 1.0 / outside_conductance_[lane];
  while (conductance[last] > 0.0) resistance += 1.0 / conductance[last++];
  const double flux = adiabatic ? 0.0 : (air - outside) / resistance;
  state_(lane, 0) = adiabatic ? air : air - flux / film;
  for (Eigen::Index j = 0; j < last; ++j) state_(lane, j + 1) = state_(lane, j) - flux / conductance[j];
}

void WallSolver::factorise(double weight, const Lanes& outside_conductance) {
  weight_ = weight;
  outside_conductance_ = outside_conductance;
  Lanes inverse_next = Lanes::Zero();
  for (Eigen::Index j = capacity_.cols() - 1; j >= 0; --j) {
    const Lanes across = weight * cell_conductance_.col(j);
    const Lanes inwards = j > 0 ? Lanes(cell_conductance_.col(j - 1)) : Lanes(to_air_ + to_star_);
    multiplier_.col(j) = across * inverse_next;
    const Lanes pivot = capacity_.col(j) + weight * (inwards + is_last_.col(j) * outside_conductance) +
                        across - across * multiplier_.col(j);
    inverse_next = (pivot > 0.0).select(pivot.inverse(), 0.0);
    inverse_pivot_.col(j) = inverse_next;
  }
}

WallSolver::Lanes WallSolver::eliminate(bool first, const Lanes& inside, const Lanes& outside) {
  const Nodes& base = first ? state_ : base_;
  const Lanes heat = weight_ * outside;
  Lanes carried = Lanes::Zero();
  for (Eigen::Index j = capacity_.cols() - 1; j >= 0; --j) {
    carried = capacity_.col(j) * base.col(j) + is_last_.col(j) * heat + multiplier_.col(j) * carried;
    rhs_.col(j) = carried;
  }
  rhs_.col(0) += weight_ * inside;
  return rhs_.col(0) * inverse_pivot_.col(0);
}

WallSolver::Lanes WallSolver::substitute(const Lanes& from_room) {
  Lanes value = (rhs_.col(0) + weight_ * from_room) * inverse_pivot_.col(0);
  Lanes outer = is_last_.col(0) * value;
  stage_.col(0) = value;
  for (Eigen::Index j = 1; j < capacity_.cols(); ++j) {
    value = rhs_.col(j) * inverse_pivot_.col(j) + multiplier_.col(j - 1) * value;
    stage_.col(j) = value;
    outer += is_last_.col(j) * value;
  }
  return outer;
}

}  // namespace amiss::zone
