#include "zone/Airflow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "zone/air.hpp"

namespace amiss::zone {
namespace {

constexpr double laminar_pressure = 1e-3;  // Pa
constexpr int max_iterations = 100;
constexpr double flow_tolerance = 1e-12;      // of the throughput
constexpr double pressure_tolerance = 1e-13;  // Pa

double crack_exponent(double width) { return 0.5 + 0.5 * std::exp(-500.0 * width); }

}  // namespace

Airflow::Airflow(const std::vector<Opening>& openings) {
  for (const Opening& opening : openings) {
    State state{};
    state.opening = &opening;
    if (opening.kind == OpeningKind::orifice) {
      state.coefficient = 0.65 * opening.area * std::sqrt(2.0);
      state.exponent = 0.5;
      state.density_power = 0.5;
    } else {
      state.exponent = crack_exponent(opening.width);
      state.coefficient = 0.0097 * opening.length * std::pow(0.0092, state.exponent);
      state.density_power = 1.0;
    }
    openings_.push_back(state);
  }
}

void Airflow::set_weather(const Eigen::Ref<const Eigen::MatrixXd>& drivers, Eigen::Index row) {
  for (State& state : openings_) {
    const Opening& opening = *state.opening;
    state.temperature = drivers(row, opening.outside);
    state.density = air_density(state.temperature);
    state.wind_pressure = 0.0;
    if (opening.wind_speed == no_column) continue;
    const double speed = opening.shelter * drivers(row, opening.wind_speed);
    const double angle = incidence_angle(drivers(row, opening.wind_direction), opening.azimuth);
    state.wind_pressure = 0.5 * state.density * speed * speed * pressure_coefficient(opening.exposure, angle);
  }
}

Airflow::Balance Airflow::flows_at(double pressure, double density_inside) {
  Balance balance{0.0, 0.0, 0.0};
  for (State& state : openings_) {
    const double dp = state.drive - pressure;
    const double density = dp > 0.0 ? state.density : density_inside;
    const double scale = state.coefficient * (state.density_power == 1.0 ? density : std::sqrt(density));
    const double square = dp * dp + laminar_pressure * laminar_pressure;
    const double power = state.exponent == 0.5 ? 1.0 / std::sqrt(std::sqrt(square))
                                               : std::pow(square, 0.5 * (state.exponent - 1.0));
    state.flow = scale * dp * power;
    balance.net += state.flow;
    balance.throughput += std::abs(state.flow);
    balance.slope -= scale * power * (1.0 + (state.exponent - 1.0) * dp * dp / square);
  }
  return balance;
}

void Airflow::solve(double air) {
  if (openings_.empty()) return;
  const double density = air_density(air);
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (State& state : openings_) {
    state.drive = state.wind_pressure + (density - state.density) * gravity * state.opening->height;
    low = std::min(low, state.drive);
    high = std::max(high, state.drive);
  }
  pressure_ = std::min(std::max(pressure_, low), high);  // low is above high where no drive is a number
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Balance balance = flows_at(pressure_, density);
    if (std::abs(balance.net) <= flow_tolerance * balance.throughput) return;
    const double correction = -balance.net / balance.slope;
    if (std::abs(correction) <= pressure_tolerance) return;
    (balance.net > 0.0 ? low : high) = pressure_;
    const double next = pressure_ + correction;
    pressure_ = next > low && next < high ? next : 0.5 * (low + high);
  }
}

}  // namespace amiss::zone
