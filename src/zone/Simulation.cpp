#include "zone/Simulation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "zone/air.hpp"

namespace amiss::zone {
namespace {

const double gamma = 1.0 - 1.0 / std::sqrt(2.0);
// Weights of the two stages, and the second stage's base: state + base_ratio (first stage - state).
const double first_weight = 1.0 - gamma;
const double second_weight = gamma;
const double base_ratio = (1.0 - gamma) / gamma;

// A sub-step may be longer than asked by rounding, no more.
constexpr double division_slack = 1e-9;
constexpr double most_substeps = 1e8;  // of an interval

void check_data(const Eigen::Ref<const Eigen::MatrixXd>& drivers, double step_s,
                const Eigen::Ref<const Eigen::VectorXd>& hold) {
  if (drivers.rows() == 0) throw std::invalid_argument("drivers: at least one row is needed; got 0");
  if (!(step_s > 0.0 && std::isfinite(step_s))) {
    throw std::invalid_argument("step_s must be a finite number above 0; got " + std::to_string(step_s));
  }
  if (hold.size() != 0 && hold.size() != drivers.rows()) {
    throw std::invalid_argument("hold must have one value per row of the drivers (" +
                                std::to_string(drivers.rows()) + ") or none; got " +
                                std::to_string(hold.size()));
  }
}

int count_substeps(double step_s, double max_substep_s) {
  const double wanted = std::ceil(step_s / max_substep_s - division_slack);
  if (wanted > most_substeps) {
    std::ostringstream message;
    message << "options: max_substep_s = " << max_substep_s << " divides an interval of " << step_s
            << " s into more than 1e8 steps; it must be longer";
    throw std::invalid_argument(message.str());
  }
  return std::max(1, static_cast<int>(wanted));
}

}  // namespace

Run simulate(const Zone& zone, const Eigen::Ref<const Eigen::MatrixXd>& drivers, double step_s,
             const Eigen::Ref<const Eigen::VectorXd>& hold, const Options& options) {
  check_data(drivers, step_s, hold);
  options.check();
  zone.check(static_cast<int>(drivers.cols()));
  return Simulation(zone, drivers, step_s, hold, options).run();
}

Simulation::Simulation(const Zone& zone, const Eigen::Ref<const Eigen::MatrixXd>& drivers, double step_s,
                       const Eigen::Ref<const Eigen::VectorXd>& hold, const Options& options)
    : zone_(zone), drivers_(drivers), hold_(hold), airflow_(zone.openings), flux_wall_(options.flux_wall) {
  if (flux_wall_ < -1 || flux_wall_ >= static_cast<int>(zone.walls.size())) {
    throw std::invalid_argument("options: flux_wall must be the number of one of the " +
                                std::to_string(zone.walls.size()) + " walls or -1; got " +
                                std::to_string(flux_wall_));
  }
  n_substeps_ = count_substeps(step_s, options.max_substep_s);
  substep_ = step_s / n_substeps_;
  stage_weight_ = gamma * substep_;
  air_capacity_ = zone.air_capacity_factor * air_density(20.0) * air_heat * zone.volume;
  add_walls(options);
  add_exchanges();
  add_heaters();
  start(options);
}

Run Simulation::run() {
  Run result;
  result.air.resize(drivers_.rows());
  if (flux_wall_ >= 0) result.flux.resize(drivers_.rows());
  begin_balance();
  for (row_ = 0; row_ < drivers_.rows(); ++row_) {
    const double before = flux_wall_ >= 0 ? lost_inwards(flux_wall_) : 0.0;
    result.air[row_] = advance_interval();
    if (flux_wall_ < 0) continue;
    const double area = zone_.walls[static_cast<std::size_t>(flux_wall_)].area;
    result.flux[row_] = (lost_inwards(flux_wall_) - before) / (area * substep_ * n_substeps_);
  }
  result.balance = balance();
  result.ok = result.air.allFinite();
  if (!result.ok) {
    result.air.setConstant(std::numeric_limits<double>::quiet_NaN());
    result.flux.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return result;
}

// ---- making ----

void Simulation::add_walls(const Options& options) {
  double area = 0.0;
  double emitting = 0.0;
  for (const Wall& wall : zone_.walls) {
    area += wall.area;
    emitting += wall.area * wall.inside_emissivity;
  }
  surfaces_emit_ = emitting > 0.0;
  for (std::size_t first = 0; first < zone_.walls.size(); first += WallSolver::kLanes) {
    std::vector<const Wall*> walls;
    for (std::size_t k = first; k < std::min(first + WallSolver::kLanes, zone_.walls.size()); ++k)
      walls.push_back(&zone_.walls[k]);
    walls_.push_back({walls, WallSolver(walls, substep_ * n_substeps_, options.cells)});
    WallGroup& group = walls_.back();
    for (std::size_t k = 0; k < walls.size(); ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      group.area_share[lane] = walls[k]->area / area;
      if (surfaces_emit_)
        group.emissivity_share[lane] = walls[k]->area * walls[k]->inside_emissivity / emitting;
    }
    group.solver.factorise(stage_weight_, group.solver.outside_conductance());
  }
  update_room_matrix();
}

void Simulation::add_exchanges() {
  const auto add = [this](const auto& components) {
    const std::size_t first = exchanges_.size();
    for (const auto& component : components) {
      Exchange exchange;
      exchange.name = component.name;
      exchanges_.push_back(exchange);
    }
    return first;
  };
  first_.window = add(zone_.windows);
  first_.opening = add(zone_.openings);
  first_.infiltration = add(zone_.infiltrations);
  first_.heater = add(zone_.heaters);
  first_.supply = add(zone_.supplies);
  first_.coupling = add(zone_.couplings);
  first_.gain = add(zone_.gains);
}

void Simulation::add_heaters() {
  for (const Heater& heater : zone_.heaters) {
    heaters_.push_back({&heater, heater.capacity / heater.conductance, drivers_(0, heater.power)});
  }
}

void Simulation::start(const Options& options) {
  air_ = zone_.initial_air;
  for (Eigen::Index i = hold_.size() - 1; i >= 0; --i) {
    if (!std::isnan(hold_[i])) air_ = hold_[i];
  }
  const double wanted = std::round(options.initial_hours * 3600.0 / (substep_ * n_substeps_));
  const auto rows = static_cast<Eigen::Index>(std::clamp(wanted, 1.0, static_cast<double>(drivers_.rows())));
  const double inside = air_ + zone_.initial_wall_offset;
  for (WallGroup& group : walls_) {
    for (std::size_t k = 0; k < group.walls.size(); ++k) {
      const Column outside = group.walls[k]->outside;
      group.solver.start_steady(static_cast<int>(k), inside,
                                outside == no_column ? inside : drivers_.col(outside).head(rows).mean());
    }
  }
  spin_up(options.spinup);
}

void Simulation::spin_up(int times) {
  for (int i = 0; i < times; ++i) {
    for (row_ = 0; row_ < drivers_.rows() && held(); ++row_) advance_interval();
  }
  row_ = 0;
}

// ---- energy balance ----

void Simulation::begin_balance() {
  hold_energy_ = 0.0;
  for (Exchange& exchange : exchanges_) exchange.energy = 0.0;
  for (WallGroup& group : walls_) group.energy.setZero();
  begun_air_ = air_;
  begun_walls_ = stored_walls();
  begun_heaters_ = stored_heaters();
}

EnergyBalance Simulation::balance() const {
  EnergyBalance result;
  for (const WallGroup& group : walls_) {
    for (std::size_t k = 0; k < group.walls.size(); ++k) {
      result.component.push_back(group.walls[k]->name);
      result.through.push_back(group.energy[static_cast<Eigen::Index>(k)]);
    }
  }
  for (const Exchange& exchange : exchanges_) {
    result.component.push_back(exchange.name);
    result.through.push_back(exchange.energy);
  }
  result.hold = hold_energy_;
  result.stored_air = air_capacity_ * (air_ - begun_air_);
  result.stored_walls = stored_walls() - begun_walls_;
  result.stored_heaters = stored_heaters() - begun_heaters_;
  return result;
}

double Simulation::stored_walls() const {
  double stored = 0.0;
  for (const WallGroup& group : walls_) stored += group.solver.stored();
  return stored;
}

// Heat that left a wall by its inner surface since the balance was begun, less a constant, J: what came
// through the outer one and is not stored.
double Simulation::lost_inwards(int wall) const {
  const WallGroup& group = walls_[static_cast<std::size_t>(wall / WallSolver::kLanes)];
  const int lane = wall % WallSolver::kLanes;
  return group.energy[lane] - group.solver.stored_in(lane);
}

double Simulation::stored_heaters() const {
  double stored = 0.0;
  for (const HeaterState& state : heaters_) stored += state.lag * state.emitted;
  return stored;
}

void Simulation::book(double mean_air) {
  for (Exchange& e : exchanges_) {
    const double heat =
        e.conductance * (e.temperature - mean_air) + e.to_air + e.by_emissivity + e.by_area + e.kept;
    e.energy += substep_ * heat;
  }
}

// ---- what holds over an interval ----

double Simulation::advance_interval() {
  if (held()) hold_air();
  set_walls();
  set_exchanges();
  airflow_.set_weather(drivers_, row_);
  double sum = 0.0;
  for (int i = 0; i < n_substeps_; ++i) sum += advance_substep();
  return sum / n_substeps_;
}

void Simulation::hold_air() {
  hold_energy_ += air_capacity_ * (hold_[row_] - air_);
  air_ = hold_[row_];
}

double Simulation::film(const Wall& wall) const {
  if (wall.wind_film == 0.0) return wall.outside_film;
  double speed = driver(wall.wind_speed);
  if (!std::isnan(wall.azimuth)) {
    speed = facade_wind(speed, incidence_angle(driver(wall.wind_direction), wall.azimuth));
  }
  return (1.0 - wall.wind_film) * wall.outside_film + wall.wind_film * (4.5 + 2.8 + 3.0 * speed);
}

// What the outer side of a wall brings with its surface at 0 degC, W.
double Simulation::outside_heat(const Wall& wall, double conductance) const {
  const double outside = driver(wall.outside);
  double absorbed = 0.0;
  if (wall.sun != no_column) absorbed += wall.absorptance * driver(wall.sun);
  if (wall.sky != no_column) {
    const double kelvin = outside + zero_celsius;
    const double black = stefan_boltzmann * kelvin * kelvin * kelvin * kelvin;
    absorbed -= wall.outside_emissivity * wall.sky_view * (black - driver(wall.sky));
  }
  return conductance * outside + wall.area * absorbed;
}

void Simulation::set_walls() {
  bool refactorised = false;
  for (WallGroup& group : walls_) {
    Lanes conductance = Lanes::Zero();
    for (std::size_t k = 0; k < group.walls.size(); ++k) {
      const Wall& wall = *group.walls[k];
      if (wall.outside == no_column) continue;
      const auto lane = static_cast<Eigen::Index>(k);
      conductance[lane] = wall.area * film(wall);
      group.outside_heat[lane] = outside_heat(wall, conductance[lane]);
    }
    if ((conductance == group.solver.outside_conductance()).all()) continue;
    group.solver.factorise(stage_weight_, conductance);
    refactorised = true;
  }
  if (refactorised) update_room_matrix();
}

// The exchanges of openings and heaters change within the interval: see set_flows() and set_heaters().
void Simulation::set_exchanges() {
  for (std::size_t i = 0; i < zone_.windows.size(); ++i) {
    const Window& window = zone_.windows[i];
    Exchange& e = exchanges_[first_.window + i];
    const double sun = window.sun == no_column ? 0.0 : window.solar_factor * window.area * driver(window.sun);
    e.conductance = window.u_value * window.area;
    e.temperature = driver(window.outside);
    e.to_air = window.to_air * sun;
    e.by_area = (1.0 - window.to_air) * sun;
  }
  for (std::size_t i = 0; i < zone_.infiltrations.size(); ++i) {
    const Infiltration& infiltration = zone_.infiltrations[i];
    Exchange& e = exchanges_[first_.infiltration + i];
    e.temperature = driver(infiltration.outside);
    const double flow = air_density(e.temperature) * zone_.volume * infiltration.ach / 3600.0;
    e.conductance = air_heat * flow;
  }
  for (std::size_t i = 0; i < zone_.supplies.size(); ++i) {
    const Supply& supply = zone_.supplies[i];
    Exchange& e = exchanges_[first_.supply + i];
    e.temperature = driver(supply.temperature);
    const double flow = air_density(e.temperature) * std::max(0.0, driver(supply.flow)) / 3600.0;
    e.conductance = supply.scale * air_heat * flow;
  }
  for (std::size_t i = 0; i < zone_.couplings.size(); ++i) {
    Exchange& e = exchanges_[first_.coupling + i];
    e.temperature = driver(zone_.couplings[i].temperature);
    e.conductance = zone_.couplings[i].conductance;
  }
  for (std::size_t i = 0; i < zone_.gains.size(); ++i) {
    const Gain& gain = zone_.gains[i];
    Exchange& e = exchanges_[first_.gain + i];
    const double power = gain.scale * driver(gain.power);
    e.to_air = (1.0 - gain.radiant_fraction) * power;
    e.by_emissivity = gain.radiant_fraction * power;
  }
}

// ---- what changes from sub-step to sub-step ----

void Simulation::set_flows() {
  airflow_.solve(air_);
  for (std::size_t i = 0; i < airflow_.size(); ++i) {
    Exchange& e = exchanges_[first_.opening + i];
    e.temperature = airflow_.outside(i);
    e.conductance = air_heat * std::max(0.0, airflow_.flow(i));
  }
}

// Exact for a power that is constant over the sub-step; the mean emission is what the zone receives.
void Simulation::set_heaters() {
  for (std::size_t i = 0; i < heaters_.size(); ++i) {
    HeaterState& state = heaters_[i];
    Exchange& e = exchanges_[first_.heater + i];
    const double power = driver(state.heater->power);
    const double before = state.emitted;
    state.emitted = state.lag > 0.0 ? power + (before - power) * std::exp(-substep_ / state.lag) : power;
    const double kept = state.lag * (state.emitted - before) / substep_;
    const double fraction = state.heater->radiant_fraction;
    e.to_air = (1.0 - fraction) * (power - kept);
    e.by_emissivity = fraction * (power - kept);
    e.kept = kept;
  }
}

// Radiant heat that finds no surface goes to the air.
void Simulation::sum_load() {
  load_ = Load{};
  for (const Exchange& e : exchanges_) {
    load_.conductance += e.conductance;
    load_.to_air += e.conductance * e.temperature + e.to_air;
    load_.by_emissivity += e.by_emissivity;
    load_.by_area += e.by_area;
  }
  if (!surfaces_emit_) load_.to_air += std::exchange(load_.by_emissivity, 0.0);
  if (walls_.empty()) load_.to_air += std::exchange(load_.by_area, 0.0);
}

void Simulation::update_room_matrix() {
  room_ = RoomMatrix{};
  for (const WallGroup& group : walls_) {
    const Lanes& air = group.solver.to_air();
    const Lanes& star = group.solver.to_star();
    const Lanes response = stage_weight_ * group.solver.surface_response();
    room_.air += air.sum();
    room_.star += star.sum();
    room_.air_air += (air * air * response).sum();
    room_.air_star += (air * star * response).sum();
    room_.star_star += (star * star * response).sum();
  }
}

// Returns the mean air temperature of the sub-step.
double Simulation::advance_substep() {
  set_flows();
  set_heaters();
  sum_load();
  const double before = air_;
  const Stage first = solve_stage(true, before, first_weight);
  for (WallGroup& group : walls_) group.solver.set_second_base(base_ratio);
  const Stage second = solve_stage(false, before + base_ratio * (first.air - before), second_weight);
  for (WallGroup& group : walls_) group.solver.accept();
  air_ = second.air;

  const double mean = first_weight * first.air + second_weight * second.air;
  if (held()) {
    const double from_walls = first_weight * first.from_walls + second_weight * second.from_walls;
    hold_energy_ -= substep_ * (from_walls + load_.to_air - load_.conductance * mean);
  }
  book(mean);
  return mean;
}

// With y0 = p + s w (gc Ta + gr Ts) on every inner surface, the equations of a stage of weight w are
//   C (Ta - base) = w (load - conductance Ta + sum gc (y0 - Ta)),    0 = sum gr (y0 - Ts).
Simulation::Stage Simulation::solve_stage(bool first, double base_air, double quadrature_weight) {
  double to_air = 0.0;   // sum gc p
  double to_star = 0.0;  // sum gr p
  for (WallGroup& group : walls_) {
    const Lanes inside = group.emissivity_share * load_.by_emissivity + group.area_share * load_.by_area;
    const Lanes surface = group.solver.eliminate(first, inside, group.outside_heat);
    to_air += (group.solver.to_air() * surface).sum();
    to_star += (group.solver.to_star() * surface).sum();
  }

  const double star_pivot = surfaces_emit_ ? room_.star - room_.star_star : 1.0;
  double air = air_;
  if (!held()) {
    const double feedback = room_.air_star / star_pivot;
    const double loss = load_.conductance + room_.air - room_.air_air - feedback * room_.air_star;
    const double gain = load_.to_air + to_air + feedback * to_star;
    air = (air_capacity_ * base_air + stage_weight_ * gain) / (air_capacity_ + stage_weight_ * loss);
  }
  const double star = (to_star + room_.air_star * air) / star_pivot;

  for (WallGroup& group : walls_) {
    const Lanes from_room = group.solver.to_air() * air + group.solver.to_star() * star;
    const Lanes outer = group.solver.substitute(from_room);
    group.energy +=
        quadrature_weight * substep_ * (group.outside_heat - group.solver.outside_conductance() * outer);
  }
  return {air, to_air + (room_.air_air - room_.air) * air + room_.air_star * star};
}

}  // namespace amiss::zone
