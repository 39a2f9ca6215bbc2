#include "zone/Zone.hpp"

#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace amiss::zone {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Checks the fields of one component, named in every message.
class Checker {
 public:
  Checker(std::string where, int n_columns) : where_(std::move(where)), n_columns_(n_columns) {}

  void positive(const char* field, double value) const {
    if (!(value > 0.0 && value < infinity)) fail(field, value, "a finite number above 0");
  }
  void non_negative(const char* field, double value) const {
    if (!(value >= 0.0 && value < infinity)) fail(field, value, "a finite number not below 0");
  }
  void share(const char* field, double value) const {
    if (!(value >= 0.0 && value <= 1.0)) fail(field, value, "a number between 0 and 1");
  }
  void finite(const char* field, double value) const {
    if (!std::isfinite(value)) fail(field, value, "a finite number");
  }
  void column(const char* field, Column value) const {
    if (value < 0 || value >= n_columns_) fail(field, value, "a column of the drivers");
  }
  void optional_column(const char* field, Column value) const {
    if (value != no_column) column(field, value);
  }
  [[noreturn]] void fail(const char* field, double value, const std::string& rule) const {
    std::ostringstream message;
    message << where_ << ": " << field << " must be " << rule << "; got " << value;
    throw std::invalid_argument(message.str());
  }

 private:
  std::string where_;
  int n_columns_;
};

std::string label(const char* kind, const std::string& name) { return std::string(kind) + " '" + name + "'"; }

template <class Component>
void check_all(const std::vector<Component>& components, int n_columns) {
  for (const Component& component : components) component.check(n_columns);
}

}  // namespace

void Layer::check(const std::string& where) const {
  const Checker checker(where, 0);
  checker.positive("thickness", thickness);
  checker.positive("conductivity", conductivity);
  checker.non_negative("capacity", capacity);
}

void Wall::check(int n_columns) const {
  const Checker checker(label("wall", name), n_columns);
  checker.positive("area", area);
  if (layers.empty()) checker.fail("layers", 0, "at least one layer");
  for (std::size_t i = 0; i < layers.size(); ++i) {
    layers[i].check(label("wall", name) + " layer " + std::to_string(i + 1));
  }
  checker.positive("inside_convection", inside_convection);
  checker.share("inside_emissivity", inside_emissivity);
  checker.optional_column("outside", outside);
  checker.positive("outside_film", outside_film);
  checker.optional_column("sun", sun);
  checker.share("absorptance", absorptance);
  checker.optional_column("sky", sky);
  checker.share("outside_emissivity", outside_emissivity);
  checker.share("sky_view", sky_view);
  checker.share("wind_film", wind_film);
  if (std::isinf(azimuth))
    checker.fail("azimuth", azimuth, "a finite number, or NaN for a horizontal surface");
  if (wind_film > 0.0) {
    checker.column("wind_speed", wind_speed);
    if (!std::isnan(azimuth)) checker.column("wind_direction", wind_direction);
  }
}

void Window::check(int n_columns) const {
  const Checker checker(label("window", name), n_columns);
  checker.positive("area", area);
  checker.non_negative("u_value", u_value);
  checker.column("outside", outside);
  checker.share("solar_factor", solar_factor);
  checker.optional_column("sun", sun);
  checker.share("to_air", to_air);
}

void Opening::check(int n_columns) const {
  const Checker checker(label("opening", name), n_columns);
  if (kind == OpeningKind::orifice) checker.non_negative("area", area);
  if (kind == OpeningKind::crack) {
    checker.non_negative("width", width);
    checker.non_negative("length", length);
  }
  checker.finite("height", height);
  checker.finite("azimuth", azimuth);
  checker.non_negative("shelter", shelter);
  checker.column("outside", outside);
  checker.optional_column("wind_speed", wind_speed);
  if (wind_speed != no_column) checker.column("wind_direction", wind_direction);
}

void Infiltration::check(int n_columns) const {
  const Checker checker(label("infiltration", name), n_columns);
  checker.non_negative("ach", ach);
  checker.column("outside", outside);
}

void Heater::check(int n_columns) const {
  const Checker checker(label("heater", name), n_columns);
  checker.column("power", power);
  checker.share("radiant_fraction", radiant_fraction);
  checker.non_negative("capacity", capacity);
  checker.positive("conductance", conductance);
}

void Supply::check(int n_columns) const {
  const Checker checker(label("supply", name), n_columns);
  checker.column("flow", flow);
  checker.column("temperature", temperature);
  checker.non_negative("scale", scale);
}

void Coupling::check(int n_columns) const {
  const Checker checker(label("coupling", name), n_columns);
  checker.non_negative("conductance", conductance);
  checker.column("temperature", temperature);
}

void Gain::check(int n_columns) const {
  const Checker checker(label("gain", name), n_columns);
  checker.column("power", power);
  checker.finite("scale", scale);
  checker.share("radiant_fraction", radiant_fraction);
}

void Zone::check(int n_columns) const {
  const Checker checker("zone", n_columns);
  checker.positive("volume", volume);
  checker.finite("initial_air", initial_air);
  checker.finite("initial_wall_offset", initial_wall_offset);
  checker.finite("air_capacity_factor", air_capacity_factor);
  if (air_capacity_factor < 1.0) {
    checker.fail("air_capacity_factor", air_capacity_factor, "a number not below 1");
  }
  check_all(walls, n_columns);
  check_all(windows, n_columns);
  check_all(openings, n_columns);
  check_all(infiltrations, n_columns);
  check_all(heaters, n_columns);
  check_all(supplies, n_columns);
  check_all(couplings, n_columns);
  check_all(gains, n_columns);
}

}  // namespace amiss::zone
