#pragma once

#include <string>
#include <vector>

#include "zone/wind.hpp"

namespace amiss::zone {

/// Index of a column of the drivers matrix; `no_column` where a component does without that driver.
using Column = int;
constexpr Column no_column = -1;

/// Every `check(n_columns)` below throws std::invalid_argument saying which field of which component is
/// wrong, the value seen and the rule, or which column lies outside 0 ... n_columns - 1.

/// One homogeneous layer of a wall.
struct Layer {
  double thickness = 0.1;     ///< m, > 0
  double conductivity = 1.0;  ///< W/(m K), > 0
  double capacity = 1e6;      ///< volumetric heat capacity, J/(m3 K), >= 0
  void check(const std::string& where) const;
};

/// An envelope element or, with no driver on its other side, an internal mass with an adiabatic back.
///
/// Inner surface: convection to the air `inside_convection`, long-wave exchange with the star node
/// `4 sigma (293.15 K)^3 inside_emissivity` (5.1 W/m2K at 0.9). Outer surface, heat inwards in W/m2:
/// `film (Te - T) + absorptance G - outside_emissivity sky_view (sigma Te^4 - Lw)`,
/// `film = (1 - wind_film) outside_film + wind_film (4.5 + 2.8 + 3 V)`, V by facade_wind(), or the wind speed
/// itself on a surface without azimuth (NaN: a roof).
struct Wall {
  std::string name = "wall";
  double area = 1.0;                  ///< m2, > 0
  std::vector<Layer> layers;          ///< from inside to outside, at least one
  double inside_convection = 3.0;     ///< W/(m2 K), > 0
  double inside_emissivity = 0.9;     ///< 0 ... 1
  Column outside = no_column;         ///< degC; none: adiabatic
  double outside_film = 25.0;         ///< convection and radiation, W/(m2 K), > 0
  Column sun = no_column;             ///< irradiance of the outer surface, W/m2
  double absorptance = 0.5;           ///< solar, 0 ... 1
  Column sky = no_column;             ///< down-welling long-wave on the horizontal, W/m2
  double outside_emissivity = 0.9;    ///< 0 ... 1
  double sky_view = 0.5;              ///< view factor to the sky, 0 ... 1
  Column wind_speed = no_column;      ///< m/s
  Column wind_direction = no_column;  ///< where it comes from, degrees from north, clockwise
  double azimuth = 0.0;    ///< of the outward normal, degrees from north, clockwise; NaN: horizontal
  double wind_film = 0.0;  ///< share of the wind-dependent film, 0 ... 1
  void check(int n_columns) const;
};

/// Glazing: conduction `u_value area (Te - Ta)` and solar gain `solar_factor area G`, of which the share
/// `to_air` goes to the air and the rest to the inner wall surfaces by area.
struct Window {
  std::string name = "window";
  double area = 1.0;           ///< m2, > 0
  double u_value = 1.1;        ///< W/(m2 K), >= 0
  Column outside = no_column;  ///< degC, needed
  double solar_factor = 0.5;   ///< g, 0 ... 1
  Column sun = no_column;      ///< irradiance in the plane of the window, W/m2; none: blinds closed
  double to_air = 0.1;         ///< 0 ... 1
  void check(int n_columns) const;
};

enum class OpeningKind { orifice, crack };

/// An opening to outside; see Airflow for its law. One alone exchanges nothing.
struct Opening {
  std::string name = "opening";
  OpeningKind kind = OpeningKind::orifice;
  double area = 1e-3;    ///< orifice, m2, >= 0
  double width = 1e-3;   ///< crack, m, >= 0
  double length = 1.0;   ///< crack, m, >= 0
  double height = 0.0;   ///< of its centre above the zone's datum, m
  double azimuth = 0.0;  ///< of its facade, degrees from north, clockwise
  Exposure exposure = Exposure::semi_exposed;
  double shelter = 1.0;               ///< reduction r of the wind speed, >= 0
  Column outside = no_column;         ///< degC, needed
  Column wind_speed = no_column;      ///< m/s; none: no wind
  Column wind_direction = no_column;  ///< degrees from north, clockwise
  void check(int n_columns) const;
};

/// A constant exchange of air with outside: mass flow `rho(Te) volume ach / 3600`.
struct Infiltration {
  std::string name = "infiltration";
  double ach = 0.2;            ///< air changes per hour, >= 0
  Column outside = no_column;  ///< degC, needed
  void check(int n_columns) const;
};

/// A heater with emitted power e: `tau de/dt = P - e`, `tau = capacity / conductance`; the radiant share goes
/// to the inner surfaces by area x emissivity, the rest to the air.
struct Heater {
  std::string name = "heater";
  Column power = no_column;       ///< W, needed
  double radiant_fraction = 0.3;  ///< 0 ... 1
  double capacity = 0.0;          ///< J/K, >= 0; 0: no lag
  double conductance = 10.0;      ///< emission, W/K, > 0
  void check(int n_columns) const;
};

/// Mechanical supply air, balanced by extraction: mass flow `scale rho(Ts) flow / 3600`.
struct Supply {
  std::string name = "supply";
  Column flow = no_column;         ///< m3/h at the supply temperature, needed; negative counts as 0
  Column temperature = no_column;  ///< degC, needed
  double scale = 1.0;              ///< >= 0
  void check(int n_columns) const;
};

/// A conductance to a known temperature: an open door, a neighbour.
struct Coupling {
  std::string name = "coupling";
  double conductance = 1.0;        ///< W/K, >= 0
  Column temperature = no_column;  ///< degC, needed
  void check(int n_columns) const;
};

/// A heat source `scale x column`: people, appliances.
struct Gain {
  std::string name = "gain";
  Column power = no_column;  ///< W, or whatever `scale` turns into W, needed
  double scale = 1.0;
  double radiant_fraction = 0.5;  ///< 0 ... 1
  void check(int n_columns) const;
};

/// One well-mixed air node and what exchanges heat with it.
/// Air capacity: `air_capacity_factor rho(20 degC) cp volume`.
struct Zone {
  double volume = 50.0;              ///< m3, > 0
  double air_capacity_factor = 1.0;  ///< >= 1, furnishings
  double initial_air = 20.0;         ///< degC, when no row is held
  double initial_wall_offset = 0.0;  ///< K: the walls start as if the air had been warmer by this
  std::vector<Wall> walls;
  std::vector<Window> windows;
  std::vector<Opening> openings;
  std::vector<Infiltration> infiltrations;
  std::vector<Heater> heaters;
  std::vector<Supply> supplies;
  std::vector<Coupling> couplings;
  std::vector<Gain> gains;
  void check(int n_columns) const;
};

}  // namespace amiss::zone
