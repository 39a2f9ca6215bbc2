#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/parallel/parallel_for.hpp"
#include "export_convert.h"
#include "zone/Simulation.hpp"

// The zone simulator for R: convert, run, convert. Column references are 0-based, -1 for none.

namespace {

using namespace amiss::zone;

double number(const Rcpp::List& component, const char* field) { return Rcpp::as<double>(component[field]); }
Column column(const Rcpp::List& component, const char* field) { return Rcpp::as<int>(component[field]); }
std::string text(const Rcpp::List& component, const char* field) {
  return Rcpp::as<std::string>(component[field]);
}

Wall read_wall(const Rcpp::List& from) {
  Wall wall;
  wall.name = text(from, "name");
  wall.area = number(from, "area");
  for (const Rcpp::List layer : Rcpp::List(from["layers"])) {
    wall.layers.push_back(
        {number(layer, "thickness"), number(layer, "conductivity"), number(layer, "capacity")});
  }
  wall.inside_convection = number(from, "inside_convection");
  wall.inside_emissivity = number(from, "inside_emissivity");
  wall.outside = column(from, "outside");
  wall.outside_film = number(from, "outside_film");
  wall.sun = column(from, "sun");
  wall.absorptance = number(from, "absorptance");
  wall.sky = column(from, "sky");
  wall.outside_emissivity = number(from, "outside_emissivity");
  wall.sky_view = number(from, "sky_view");
  wall.wind_speed = column(from, "wind_speed");
  wall.wind_direction = column(from, "wind_direction");
  wall.azimuth = number(from, "azimuth");
  wall.wind_film = number(from, "wind_film");
  return wall;
}

Window read_window(const Rcpp::List& from) {
  return {text(from, "name"),      number(from, "area"),         number(from, "u_value"),
          column(from, "outside"), number(from, "solar_factor"), column(from, "sun"),
          number(from, "to_air")};
}

Exposure read_exposure(const std::string& name) {
  if (name == "exposed") return Exposure::exposed;
  if (name == "semi-exposed") return Exposure::semi_exposed;
  if (name == "sheltered") return Exposure::sheltered;
  throw std::invalid_argument("zone: unknown exposure '" + name + "'");
}

Opening read_opening(const Rcpp::List& from, OpeningKind kind) {
  Opening opening;
  opening.name = text(from, "name");
  opening.kind = kind;
  if (kind == OpeningKind::orifice) {
    opening.area = number(from, "area");
  } else {
    opening.width = number(from, "width");
    opening.length = number(from, "length");
  }
  opening.height = number(from, "height");
  opening.azimuth = number(from, "azimuth");
  opening.exposure = read_exposure(text(from, "exposure"));
  opening.shelter = number(from, "shelter");
  opening.outside = column(from, "outside");
  opening.wind_speed = column(from, "wind_speed");
  opening.wind_direction = column(from, "wind_direction");
  return opening;
}

Infiltration read_infiltration(const Rcpp::List& from) {
  return {text(from, "name"), number(from, "ach"), column(from, "outside")};
}

Heater read_heater(const Rcpp::List& from) {
  return {text(from, "name"), column(from, "power"), number(from, "radiant_fraction"),
          number(from, "capacity"), number(from, "conductance")};
}

Supply read_supply(const Rcpp::List& from) {
  return {text(from, "name"), column(from, "flow"), column(from, "temperature"), number(from, "scale")};
}

Coupling read_coupling(const Rcpp::List& from) {
  return {text(from, "name"), number(from, "conductance"), column(from, "temperature")};
}

Gain read_gain(const Rcpp::List& from) {
  return {text(from, "name"), column(from, "power"), number(from, "scale"), number(from, "radiant_fraction")};
}

using Reader = void (*)(const Rcpp::List&, Zone&);
const std::map<std::string, Reader> component_readers = {
    {"wall", [](const Rcpp::List& from, Zone& zone) { zone.walls.push_back(read_wall(from)); }},
    {"window", [](const Rcpp::List& from, Zone& zone) { zone.windows.push_back(read_window(from)); }},
    {"opening", [](const Rcpp::List& from,
                   Zone& zone) { zone.openings.push_back(read_opening(from, OpeningKind::orifice)); }},
    {"crack", [](const Rcpp::List& from,
                 Zone& zone) { zone.openings.push_back(read_opening(from, OpeningKind::crack)); }},
    {"infiltration",
     [](const Rcpp::List& from, Zone& zone) { zone.infiltrations.push_back(read_infiltration(from)); }},
    {"heater", [](const Rcpp::List& from, Zone& zone) { zone.heaters.push_back(read_heater(from)); }},
    {"supply", [](const Rcpp::List& from, Zone& zone) { zone.supplies.push_back(read_supply(from)); }},
    {"coupling", [](const Rcpp::List& from, Zone& zone) { zone.couplings.push_back(read_coupling(from)); }},
    {"gain", [](const Rcpp::List& from, Zone& zone) { zone.gains.push_back(read_gain(from)); }}};

void read_component(const Rcpp::List& from, Zone& zone) {
  const auto reader = component_readers.find(text(from, "type"));
  if (reader == component_readers.end())
    throw std::invalid_argument("zone: unknown component '" + text(from, "type") + "'");
  reader->second(from, zone);
}

Zone read_zone(const Rcpp::List& from) {
  Zone zone;
  zone.volume = number(from, "volume");
  zone.air_capacity_factor = number(from, "air_capacity_factor");
  zone.initial_air = number(from, "initial_air");
  zone.initial_wall_offset = number(from, "initial_wall_offset");
  for (const Rcpp::List component : Rcpp::List(from["components"])) read_component(component, zone);
  return zone;
}

void set_field(SEXP list, const Rcpp::IntegerVector& path, double value) {
  for (R_xlen_t k = 0; k + 1 < path.size(); ++k) list = VECTOR_ELT(list, path[k] - 1);
  SET_VECTOR_ELT(list, path[path.size() - 1] - 1, Rf_ScalarReal(value));
}

// One zone for each row of the values.
std::vector<Zone> read_zones(const Rcpp::List& zone, const Rcpp::List& paths, const Eigen::MatrixXd& values) {
  std::vector<Zone> zones;
  const Rcpp::List filled = Rcpp::clone(zone);
  for (Eigen::Index run = 0; run < values.rows(); ++run) {
    for (Eigen::Index k = 0; k < values.cols(); ++k) set_field(filled, paths[k], values(run, k));
    zones.push_back(read_zone(filled));
  }
  return zones;
}

Options read_options(const Rcpp::List& from) {
  Options options;
  options.max_substep_s = number(from, "max_substep_s");
  options.cells = number(from, "cells");
  options.spinup = Rcpp::as<int>(from["spinup"]);
  options.initial_hours = number(from, "initial_hours");
  if (from.containsElementNamed("flux_wall")) options.flux_wall = Rcpp::as<int>(from["flux_wall"]);
  return options;
}

}  // namespace

// N x M mean air temperatures of one zone, or heat fluxes of its wall `control$flux_wall` (from 0), whose
// free fields have the values of a row of `values` (M x fields) in each run. `paths`: where each field stands
// in the nested list, from 1.
// [[Rcpp::export]]
Eigen::MatrixXd zone_simulate_(Rcpp::List zone, Rcpp::List paths, Eigen::MatrixXd values,
                               Eigen::MatrixXd drivers, double step_s, Eigen::VectorXd hold,
                               Rcpp::List control, Rcpp::List context) {
  const Options options = read_options(control);
  const std::vector<Zone> zones = read_zones(zone, paths, values);
  for (const Zone& read : zones) read.check(drivers.cols());
  options.check();
  Eigen::MatrixXd output(drivers.rows(), values.rows());
  amiss::parallel_for(static_cast<int>(zones.size()), amiss::convert::context(context), [&](int run) {
    const Run result = simulate(zones[static_cast<std::size_t>(run)], drivers, step_s, hold, options);
    output.col(run) = options.flux_wall < 0 ? result.air : result.flux;
  });
  return output;
}

// One run with its energy balance: list(air, through (named, J), hold, stored (named, J)).
// [[Rcpp::export]]
Rcpp::List zone_balance_(Rcpp::List zone, Eigen::MatrixXd drivers, double step_s, Eigen::VectorXd hold,
                         Rcpp::List control) {
  const Run run = simulate(read_zone(zone), drivers, step_s, hold, read_options(control));
  const EnergyBalance& balance = run.balance;
  Rcpp::NumericVector through(balance.through.begin(), balance.through.end());
  through.names() = Rcpp::wrap(balance.component);
  return Rcpp::List::create(
      Rcpp::_["air"] = Rcpp::NumericVector(run.air.data(), run.air.data() + run.air.size()),
      Rcpp::_["through"] = through, Rcpp::_["hold"] = balance.hold,
      Rcpp::_["stored"] = Rcpp::NumericVector::create(Rcpp::_["air"] = balance.stored_air,
                                                      Rcpp::_["walls"] = balance.stored_walls,
                                                      Rcpp::_["heaters"] = balance.stored_heaters));
}
