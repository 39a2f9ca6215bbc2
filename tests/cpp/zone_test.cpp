#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/parallel/parallel_for.hpp"
#include "zone/Airflow.hpp"
#include "zone/Simulation.hpp"
#include "zone/air.hpp"
#include "zone/wind.hpp"

namespace amiss::zone {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

constexpr double pi = 3.14159265358979323846;
const VectorXd no_hold;

enum : Column { outdoor, power, sun, speed, direction, sky, flow, supply_air, n_columns };

MatrixXd constant_drivers(Eigen::Index rows, double outside, double watts) {
  MatrixXd drivers = MatrixXd::Zero(rows, n_columns);
  drivers.col(outdoor).setConstant(outside);
  drivers.col(power).setConstant(watts);
  return drivers;
}

Wall plain_wall() {
  Wall wall;
  wall.area = 10.0;
  wall.layers = {{0.012, 0.25, 1e6}, {0.08, 0.04, 4e4}, {0.12, 0.8, 1.6e6}};
  wall.inside_emissivity = 0.0;
  wall.outside = outdoor;
  return wall;
}

Heater convector() {
  Heater heater;
  heater.power = power;
  heater.radiant_fraction = 0.0;
  return heater;
}

double wall_u(const Wall& wall) {
  double resistance = 1.0 / wall.inside_convection + 1.0 / wall.outside_film;
  for (const Layer& layer : wall.layers) resistance += layer.thickness / layer.conductivity;
  return 1.0 / resistance;
}

Zone heated_zone() {
  Zone zone;
  zone.volume = 30.0;
  zone.walls = {plain_wall()};
  zone.heaters = {convector()};
  return zone;
}

/// Weather and loads that vary in every column.
MatrixXd lively_drivers(Eigen::Index rows) {
  MatrixXd drivers(rows, n_columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double t = 2.0 * pi * static_cast<double>(i) / 96.0;
    drivers(i, outdoor) = 8.0 + 6.0 * std::sin(t);
    drivers(i, power) = (i / 7) % 2 == 0 ? 800.0 : 0.0;
    drivers(i, sun) = std::max(0.0, 500.0 * std::sin(t));
    drivers(i, speed) = 3.0 + 2.0 * std::sin(3.1 * t);
    drivers(i, direction) = std::fmod(40.0 * static_cast<double>(i), 360.0);
    drivers(i, sky) = 280.0 + 20.0 * std::cos(t);
    drivers(i, flow) = 60.0 + 20.0 * std::cos(2.0 * t);
    drivers(i, supply_air) = 17.0;
  }
  return drivers;
}

Zone everything() {
  Zone zone = heated_zone();
  zone.air_capacity_factor = 4.0;
  Wall facade = plain_wall();
  facade.name = "facade";
  facade.inside_emissivity = 0.9;
  facade.sun = sun;
  facade.sky = sky;
  facade.wind_speed = speed;
  facade.wind_direction = direction;
  facade.wind_film = 0.7;
  Wall mass = plain_wall();
  mass.name = "mass";
  mass.inside_emissivity = 0.6;
  mass.outside = no_column;
  zone.walls = {facade, mass};
  zone.windows = {{"window", 2.0, 1.2, outdoor, 0.5, sun, 0.1}};
  Opening low;
  low.outside = outdoor;
  low.wind_speed = speed;
  low.wind_direction = direction;
  low.area = 0.01;
  Opening high = low;
  high.height = 2.0;
  high.azimuth = 180.0;
  high.kind = OpeningKind::crack;
  zone.openings = {low, high};
  zone.infiltrations = {{"infiltration", 0.1, outdoor}};
  zone.heaters[0] = {"heater", power, 0.4, 8000.0, 10.0};
  zone.supplies = {{"supply", flow, supply_air, 0.9}};
  zone.couplings = {{"door", 15.0, supply_air}};
  zone.gains = {{"people", power, 0.1, 0.5}};
  return zone;
}

TEST(Zone, SteadyHeatLossIsClosedForm) {
  Zone zone = heated_zone();
  zone.windows = {{"window", 2.0, 1.3, outdoor, 0.5, no_column, 0.1}};
  zone.couplings = {{"door", 4.0, outdoor}};
  zone.infiltrations = {{"infiltration", 0.5, outdoor}};
  const double air_loss = air_density(-5.0) * air_heat * 30.0 * 0.5 / 3600.0;
  const double loss = 10.0 * wall_u(zone.walls[0]) + 2.0 * 1.3 + 4.0 + air_loss;
  const auto run = simulate(zone, constant_drivers(2000, -5.0, 300.0), 3600.0, no_hold, {});
  EXPECT_NEAR(run.air[1999], -5.0 + 300.0 / loss, 1e-8);
}

TEST(Zone, SolAirAndSkyShiftTheSteadyState) {
  Zone zone = heated_zone();
  Wall& wall = zone.walls[0];
  wall.sun = sun;
  wall.absorptance = 0.6;
  wall.sky = sky;
  wall.sky_view = 0.4;
  MatrixXd drivers = constant_drivers(2000, 10.0, 0.0);
  drivers.col(sun).setConstant(200.0);
  drivers.col(sky).setConstant(290.0);
  const double sky_loss = 0.9 * 0.4 * (stefan_boltzmann * std::pow(283.15, 4) - 290.0);
  const auto run = simulate(zone, drivers, 3600.0, no_hold, {});
  EXPECT_NEAR(run.air[1999], 10.0 + (0.6 * 200.0 - sky_loss) / wall.outside_film, 1e-8);
}

TEST(Zone, WindFilmSetsTheOuterResistance) {
  Zone zone = heated_zone();
  Wall& wall = zone.walls[0];
  wall.wind_film = 0.5;
  wall.wind_speed = speed;
  wall.azimuth = std::numeric_limits<double>::quiet_NaN();
  MatrixXd drivers = constant_drivers(2000, 0.0, 200.0);
  drivers.col(speed).setConstant(4.0);
  const auto run = simulate(zone, drivers, 3600.0, no_hold, {});
  wall.outside_film = 0.5 * 25.0 + 0.5 * (4.5 + 2.8 + 3.0 * 4.0);
  EXPECT_NEAR(run.air[1999], 200.0 / (10.0 * wall_u(wall)), 1e-8);
}

TEST(Zone, RadiantHeatIsSharedByAreaTimesEmissivity) {
  Zone zone = heated_zone();
  zone.heaters[0].radiant_fraction = 1.0;
  Wall lossy = plain_wall();
  lossy.inside_emissivity = 0.9;
  lossy.layers = {{0.1, 0.5, 1e6}};
  Wall tight = lossy;
  tight.inside_emissivity = 0.3;
  tight.layers = {{0.1, 0.05, 1e6}};
  zone.walls = {lossy, tight};
  const auto run = simulate(zone, constant_drivers(4000, 0.0, 100.0), 3600.0, no_hold, {});

  // The steady network of two surfaces, air and star, solved directly.
  const double star = 4.0 * stefan_boltzmann * std::pow(293.15, 3);
  Eigen::Matrix4d k = Eigen::Matrix4d::Zero();
  const auto link = [&k](int a, int b, double g) {
    k(a, a) += g;
    k(b, b) += g;
    k(a, b) -= g;
    k(b, a) -= g;
  };
  link(0, 2, 30.0);
  link(1, 2, 30.0);
  link(0, 3, 10.0 * 0.9 * star);
  link(1, 3, 10.0 * 0.3 * star);
  k(0, 0) += 10.0 / (0.1 / 0.5 + 1.0 / 25.0);
  k(1, 1) += 10.0 / (0.1 / 0.05 + 1.0 / 25.0);
  const Eigen::Vector4d temperature = k.fullPivLu().solve(Eigen::Vector4d(75.0, 25.0, 0.0, 0.0));
  EXPECT_NEAR(run.air[3999], temperature[2], 1e-8);
}

TEST(Zone, RadiantHeatWithoutSurfacesGoesToTheAir) {
  Zone zone = heated_zone();
  zone.walls.clear();
  zone.heaters[0].radiant_fraction = 1.0;
  zone.couplings = {{"door", 5.0, outdoor}};
  const auto run = simulate(zone, constant_drivers(200, 0.0, 50.0), 3600.0, no_hold, {});
  EXPECT_NEAR(run.air[199], 10.0, 1e-8);
}

// Heat taken up by a slab with an adiabatic back when the air jumps: the series of Carslaw and Jaeger.
TEST(Zone, SlabStepResponseFollowsTheSeries) {
  const double length = 0.2, conductivity = 0.8, capacity = 1.6e6, film = 3.0, area = 10.0;
  Zone zone;
  Wall slab = plain_wall();
  slab.layers = {{length, conductivity, capacity}};
  slab.outside = no_column;
  zone.walls = {slab};
  const int rows = 37;
  const double step = 600.0;
  VectorXd hold = VectorXd::Constant(rows, 25.0);
  hold[0] = 20.0;
  const auto run = simulate(zone, constant_drivers(rows, 0.0, 0.0), step, hold, {});

  const double biot = film * length / conductivity;
  const double fourier = conductivity / capacity * (rows - 1) * step / (length * length);
  double left = 0.0;
  for (int n = 0; n < 50; ++n) {
    double low = n * pi, high = n * pi + pi / 2.0;
    for (int i = 0; i < 80; ++i) {
      const double root = 0.5 * (low + high);
      (root * std::tan(root) < biot ? low : high) = root;
    }
    const double z = 0.5 * (low + high);
    left += 2.0 * biot * biot / (z * z * (z * z + biot * biot + biot)) * std::exp(-z * z * fourier);
  }
  const double expected = area * length * capacity * 5.0 * (1.0 - left);
  EXPECT_NEAR(run.balance.stored_walls / expected, 1.0, 2e-3);
  Options fine;
  fine.cells = 8.0;
  fine.max_substep_s = 20.0;
  const auto refined = simulate(zone, constant_drivers(rows, 0.0, 0.0), step, hold, fine);
  EXPECT_NEAR(refined.balance.stored_walls / expected, 1.0, 1e-4);
}

/// Heat transfer matrix of a wall (ISO 13786): (T, q) outside from (T, q) inside, q positive outwards.
Eigen::Matrix2cd transfer_matrix(const Wall& wall, double omega) {
  const auto film = [](double h) {
    Eigen::Matrix2cd m;
    m << 1.0, -1.0 / h, 0.0, 1.0;
    return m;
  };
  Eigen::Matrix2cd matrix = film(wall.inside_convection);
  for (const Layer& layer : wall.layers) {
    const Complex root = std::sqrt(Complex(0.0, omega) * layer.capacity / layer.conductivity);
    const Complex xi = root * layer.thickness;
    const Complex admittance = root * layer.conductivity;
    Eigen::Matrix2cd m;
    m << std::cosh(xi), -std::sinh(xi) / admittance, -admittance * std::sinh(xi), std::cosh(xi);
    matrix = m * matrix;
  }
  return film(wall.outside_film) * matrix;
}

/// Complex amplitude at `omega` of the last `rows` values.
Complex amplitude(const VectorXd& values, Eigen::Index rows, double step, double omega) {
  Complex sum = 0.0;
  for (Eigen::Index i = values.size() - rows; i < values.size(); ++i) {
    sum += values[i] * std::exp(Complex(0.0, -omega * (static_cast<double>(i) + 0.5) * step));
  }
  return 2.0 * sum / static_cast<double>(rows);
}

TEST(Zone, PeriodicResponseMatchesTheTransferMatrix) {
  const double step = 300.0;
  const double omega = 2.0 * pi / 86400.0;
  const Eigen::Index day = 288, rows = 30 * day;
  Zone zone = heated_zone();
  const double air_capacity = air_density(20.0) * air_heat * zone.volume;
  const Eigen::Matrix2cd z = transfer_matrix(zone.walls[0], omega);
  const Complex stored = Complex(0.0, omega) * air_capacity / 10.0;
  MatrixXd weather = constant_drivers(rows, 0.0, 0.0);
  MatrixXd heating = weather;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double wave = std::cos(omega * (static_cast<double>(i) + 0.5) * step);
    weather(i, outdoor) = 10.0 * wave;
    heating(i, power) = 100.0 * wave;
  }
  zone.initial_air = 0.0;

  // No heat in the room: q = -stored T inside, T = 10 outside.
  const Complex by_weather = 10.0 / (z(0, 0) - z(0, 1) * stored);
  const Complex seen = amplitude(simulate(zone, weather, step, no_hold, {}).air, day, step, omega);
  EXPECT_LT(std::abs(seen - by_weather) / std::abs(by_weather), 2e-3);

  // T = 0 outside: z00 T + z01 q = 0 with q = 100 W / 10 m2 - stored T inside.
  const Complex by_heat = -z(0, 1) * 10.0 / (z(0, 0) - z(0, 1) * stored);
  const Complex warmed = amplitude(simulate(zone, heating, step, no_hold, {}).air, day, step, omega);
  EXPECT_LT(std::abs(warmed - by_heat) / std::abs(by_heat), 2e-3);
}

TEST(Zone, EnergyBalanceClosesWithEverythingOn) {
  const MatrixXd drivers = lively_drivers(400);
  VectorXd hold = VectorXd::Constant(400, std::numeric_limits<double>::quiet_NaN());
  for (int i = 0; i < 60; ++i) hold[i] = 20.0 + std::sin(0.3 * i);
  Options options;
  options.spinup = 2;
  const EnergyBalance balance = simulate(everything(), drivers, 900.0, hold, options).balance;
  const double brought = std::accumulate(balance.through.begin(), balance.through.end(), balance.hold);
  const double stored = balance.stored_air + balance.stored_walls + balance.stored_heaters;
  double turnover = 0.0;
  int idle = 0;
  for (double heat : balance.through) {
    if (heat == 0.0) ++idle;
    turnover += std::abs(heat);
  }
  EXPECT_EQ(idle, 1) << "only the adiabatic mass brings nothing";
  EXPECT_NE(balance.hold, 0.0);
  EXPECT_NE(balance.stored_heaters, 0.0);
  EXPECT_NEAR(brought, stored, 1e-9 * turnover);
}

TEST(Zone, HeaterEnergyIsThePowerDrawn) {
  const MatrixXd drivers = lively_drivers(200);
  const EnergyBalance balance = simulate(everything(), drivers, 900.0, no_hold, {}).balance;
  for (std::size_t i = 0; i < balance.component.size(); ++i) {
    if (balance.component[i] != "heater") continue;
    EXPECT_NEAR(balance.through[i], drivers.col(power).sum() * 900.0, 1e-3);
    return;
  }
  FAIL() << "no heater in the balance";
}

TEST(Zone, ConvergesWithOrderTwo) {
  Zone zone = everything();
  zone.openings.clear();
  const MatrixXd drivers = lively_drivers(48);
  const auto run = [&](double substep) {
    Options options;
    options.max_substep_s = substep;
    return simulate(zone, drivers, 3600.0, no_hold, options).air;
  };
  const VectorXd exact = run(3600.0 / 512.0);
  const double coarse = (run(225.0) - exact).norm();
  const double fine = (run(112.5) - exact).norm();
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.15);
}

TEST(Zone, FlowsBetweenTwoHeightsMatchTheStackFormula) {
  Opening low;
  low.area = 0.02;
  low.outside = outdoor;
  Opening high = low;
  high.height = 3.0;
  const std::vector<Opening> openings = {low, high};
  Airflow airflow(openings);
  airflow.set_weather(constant_drivers(1, 0.0, 0.0), 0);
  airflow.solve(20.0);
  const double outside = air_density(0.0), inside = air_density(20.0);
  const double drive = (outside - inside) * gravity * 3.0;
  const double expected = 0.65 * 0.02 * std::sqrt(2.0 * outside * inside * drive / (outside + inside));
  EXPECT_NEAR(airflow.flow(0), expected, 1e-5 * expected);
  EXPECT_NEAR(airflow.flow(0) + airflow.flow(1), 0.0, 1e-12 * expected);
}

TEST(Zone, MassBalanceClosesInWind) {
  const Zone zone = everything();
  const MatrixXd drivers = lively_drivers(300);
  Airflow airflow(zone.openings);
  for (Eigen::Index row = 0; row < drivers.rows(); ++row) {
    airflow.set_weather(drivers, row);
    airflow.solve(21.0);
    EXPECT_GT(std::abs(airflow.flow(0)), 0.0);
    EXPECT_NEAR(airflow.flow(0) + airflow.flow(1), 0.0, 1e-9 * std::abs(airflow.flow(0)));
  }
}

TEST(Zone, CrackFollowsItsPowerLaw) {
  Opening crack;
  crack.kind = OpeningKind::crack;
  crack.width = 0.001;
  crack.length = 2.0;
  crack.outside = outdoor;
  crack.wind_speed = speed;
  crack.wind_direction = direction;
  crack.exposure = Exposure::exposed;
  Opening door = crack;  // so large that the zone takes the pressure of its facade
  door.kind = OpeningKind::orifice;
  door.area = 1e3;
  door.azimuth = 180.0;
  MatrixXd drivers = constant_drivers(1, 20.0, 0.0);
  drivers(0, speed) = 5.0;
  const std::vector<Opening> openings = {crack, door};
  Airflow airflow(openings);
  airflow.set_weather(drivers, 0);
  airflow.solve(40.0);  // warm inside: the inflow has the density of outside
  const double density = air_density(20.0);
  const double dp = (0.70 + 0.20) * 0.5 * density * 25.0;
  const double x = 0.5 + 0.5 * std::exp(-0.5);
  EXPECT_NEAR(airflow.flow(0) / (density * 0.0097 * 2.0 * std::pow(0.0092, x) * std::pow(dp, x)), 1.0, 1e-6);
}

TEST(Zone, OneOpeningExchangesNothing) {
  Zone zone = everything();
  zone.openings.resize(1);
  Zone sealed = zone;
  sealed.openings.clear();
  const MatrixXd drivers = lively_drivers(100);
  const VectorXd open = simulate(zone, drivers, 900.0, no_hold, {}).air;
  EXPECT_EQ((open - simulate(sealed, drivers, 900.0, no_hold, {}).air).norm(), 0.0);
  const VectorXd draughty = simulate(everything(), drivers, 900.0, no_hold, {}).air;
  EXPECT_GT((open - draughty).cwiseAbs().maxCoeff(), 0.01);
}

TEST(Zone, PressureCoefficientsAreTheTableAtItsNodes) {
  const double exposed[] = {0.70, 0.525, 0.35, -0.075, -0.50, -0.45, -0.40, -0.30, -0.20};
  const double semi[] = {0.40, 0.25, 0.10, -0.10, -0.30, -0.325, -0.35, -0.275, -0.20};
  const double sheltered[] = {0.20, 0.125, 0.05, -0.10, -0.25, -0.275, -0.30, -0.275, -0.25};
  for (int i = 0; i < 9; ++i) {
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::exposed, 22.5 * i), exposed[i]);
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::semi_exposed, 22.5 * i), semi[i]);
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::sheltered, 22.5 * i), sheltered[i]);
  }
}

TEST(Zone, PressureCoefficientIsSmooth) {
  const double h = 1e-5;
  for (int i = 1; i < 8; ++i) {
    const double at = 22.5 * i;
    const double middle = pressure_coefficient(Exposure::exposed, at);
    const double right = (pressure_coefficient(Exposure::exposed, at + h) - middle) / h;
    const double left = (middle - pressure_coefficient(Exposure::exposed, at - h)) / h;
    EXPECT_NEAR(right, left, 1e-5);
  }
  EXPECT_NEAR(pressure_coefficient(Exposure::exposed, h), 0.70, 1e-9);
}

TEST(Zone, PressureCoefficientStaysBetweenItsNodes) {
  for (const Exposure exposure : {Exposure::exposed, Exposure::semi_exposed, Exposure::sheltered}) {
    for (double angle = 0.25; angle < 180.0; angle += 0.25) {
      const double node = std::floor(angle / 22.5) * 22.5;
      const double before = pressure_coefficient(exposure, node);
      const double after = pressure_coefficient(exposure, node + 22.5);
      const double between = pressure_coefficient(exposure, angle);
      EXPECT_GE(between, std::min(before, after) - 1e-12);
      EXPECT_LE(between, std::max(before, after) + 1e-12);
    }
  }
}

TEST(Zone, IncidenceAngleWrapsAroundNorth) {
  EXPECT_DOUBLE_EQ(incidence_angle(350.0, 10.0), 20.0);
  EXPECT_DOUBLE_EQ(incidence_angle(10.0, 350.0), 20.0);
  EXPECT_DOUBLE_EQ(incidence_angle(270.0, 90.0), 180.0);
}

TEST(Zone, FacadeWindIsContinuousAndWeakInTheLee) {
  EXPECT_DOUBLE_EQ(facade_wind(4.0, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(facade_wind(4.0, 45.0), 4.0 * std::sqrt(0.5));
  EXPECT_NEAR(facade_wind(4.0, 135.0), std::sqrt(0.5), 1e-12);
  for (double angle = 0.0; angle < 179.9; angle += 0.1) {
    EXPECT_NEAR(facade_wind(1.0, angle), facade_wind(1.0, angle + 0.1), 0.01);
  }
}

// Air alone with a weak loss: its temperature integrates the emitted power e = P (1 - exp(-t / tau)).
TEST(Zone, HeaterLagIsExponential) {
  Zone zone;
  zone.heaters = {convector()};
  zone.heaters[0].capacity = 18000.0;
  zone.heaters[0].conductance = 10.0;
  MatrixXd drivers = constant_drivers(11, 0.0, 200.0);
  drivers(0, power) = 0.0;
  const EnergyBalance balance = simulate(zone, drivers, 600.0, no_hold, {}).balance;
  const double tau = 1800.0, time = 6000.0;
  EXPECT_NEAR(balance.stored_heaters, tau * 200.0 * (1.0 - std::exp(-time / tau)), 1e-6);
  EXPECT_NEAR(balance.stored_air, 200.0 * (time - tau * (1.0 - std::exp(-time / tau))), 1e-5);
}

TEST(Zone, HeldAirIsPrescribedAndThenReleased) {
  Zone zone = heated_zone();
  const MatrixXd drivers = constant_drivers(300, 0.0, 0.0);
  VectorXd hold = VectorXd::Constant(300, std::numeric_limits<double>::quiet_NaN());
  hold.head(100).setConstant(22.0);
  hold[50] = 18.0;
  const auto run = simulate(zone, drivers, 900.0, hold, {});
  EXPECT_NEAR((run.air.head(100) - hold.head(100)).cwiseAbs().maxCoeff(), 0.0, 1e-12);
  EXPECT_LT(run.air[100], 22.0);
  EXPECT_GT(run.air[100], run.air[101]);
  // The walls start in the steady state of the first held value, so the hold pays exactly their loss.
  hold.setConstant(22.0);
  const auto steady = simulate(zone, drivers, 900.0, hold, {});
  EXPECT_NEAR(steady.balance.hold / (300 * 900.0 * 10.0 * wall_u(zone.walls[0]) * 22.0), 1.0, 1e-10);
}

TEST(Zone, SpinUpLetsTheWallsForgetTheirStart) {
  Zone zone = heated_zone();
  MatrixXd drivers = constant_drivers(200, 0.0, 0.0);
  drivers.col(outdoor).head(10).setConstant(30.0);
  VectorXd hold = VectorXd::Constant(200, std::numeric_limits<double>::quiet_NaN());
  hold.head(100).setConstant(20.0);
  Options start_warm, start_cold;
  start_warm.initial_hours = 1.0;
  start_cold.initial_hours = 1000.0;
  const auto difference = [&](int spinup) {
    start_warm.spinup = start_cold.spinup = spinup;
    return (simulate(zone, drivers, 900.0, hold, start_warm).air -
            simulate(zone, drivers, 900.0, hold, start_cold).air)
        .cwiseAbs()
        .maxCoeff();
  };
  EXPECT_GT(difference(0), 1e-3);
  EXPECT_LT(difference(5), 0.1 * difference(0));
}

TEST(Zone, DefaultsAreAccurateOnSwitchedHeating) {
  Zone zone = everything();
  zone.walls[0].layers = {{0.01, 0.25, 1e6}, {0.3, 0.22, 8e5}, {0.12, 0.04, 5e4}, {0.01, 0.8, 1.6e6}};
  const MatrixXd drivers = lively_drivers(400);
  Options fine;
  fine.max_substep_s = 900.0 / 48.0;
  fine.cells = 16.0;
  const VectorXd exact = simulate(zone, drivers, 900.0, no_hold, fine).air;
  const VectorXd usual = simulate(zone, drivers, 900.0, no_hold, {}).air;
  const double swing = exact.maxCoeff() - exact.minCoeff();
  EXPECT_LT((usual - exact).cwiseAbs().maxCoeff(), 0.005 * swing);
  EXPECT_LT(std::sqrt((usual - exact).squaredNorm() / 400.0), 0.002 * swing);
}

TEST(Zone, NonFiniteDriverGivesAFailedRun) {
  MatrixXd drivers = constant_drivers(10, 0.0, 0.0);
  drivers(5, outdoor) = std::numeric_limits<double>::infinity();
  const auto run = simulate(heated_zone(), drivers, 900.0, no_hold, {});
  EXPECT_FALSE(run.ok);
  EXPECT_TRUE(std::isnan(run.air[0]));
}

TEST(Zone, AWindFromNowhereGivesAFailedRun) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(pressure_coefficient(Exposure::exposed, nan)));
  MatrixXd drivers = lively_drivers(10);
  drivers(5, direction) = nan;
  EXPECT_FALSE(simulate(everything(), drivers, 900.0, no_hold, {}).ok);
  drivers.col(outdoor).setConstant(nan);
  EXPECT_FALSE(simulate(everything(), drivers, 900.0, no_hold, {}).ok);
}

TEST(Zone, OneAndTwoThreadsGiveTheSameBits) {
  const MatrixXd drivers = lively_drivers(96);
  const auto runs = [&](int threads) {
    MatrixXd air(drivers.rows(), 6);
    Context context;
    context.threads = threads;
    parallel_for(6, context, [&](int i) {
      Zone zone = everything();
      zone.volume += i;
      air.col(i) = simulate(zone, drivers, 900.0, no_hold, {}).air;
    });
    return air;
  };
  EXPECT_EQ(runs(1), runs(2));
}

void expect_message(const Zone& zone, const std::string& expected) {
  try {
    simulate(zone, constant_drivers(2, 0.0, 0.0), 900.0, no_hold, {});
    FAIL() << "nothing thrown; expected: " << expected;
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()), expected);
  }
}

TEST(Zone, ChecksNameComponentFieldAndValue) {
  Zone zone = heated_zone();
  zone.walls[0].layers[1].thickness = -0.1;
  expect_message(zone, "wall 'wall' layer 2: thickness must be a finite number above 0; got -0.1");
  zone = heated_zone();
  zone.heaters[0].power = 99;
  expect_message(zone, "heater 'heater': power must be a column of the drivers; got 99");
  zone = heated_zone();
  zone.air_capacity_factor = 0.5;
  expect_message(zone, "zone: air_capacity_factor must be a number not below 1; got 0.5");
}

TEST(Zone, ChecksOptionsAndData) {
  Options options;
  options.max_substep_s = 0.0;
  const MatrixXd drivers = constant_drivers(2, 0.0, 0.0);
  EXPECT_THROW(simulate(heated_zone(), drivers, 900.0, no_hold, options), std::invalid_argument);
  EXPECT_THROW(simulate(heated_zone(), drivers, -1.0, no_hold, {}), std::invalid_argument);
  EXPECT_THROW(simulate(heated_zone(), drivers, 900.0, VectorXd::Zero(3), {}), std::invalid_argument);
  // What is too fine to be counted.
  options = {};
  options.max_substep_s = 1e-300;
  EXPECT_THROW(simulate(heated_zone(), drivers, 900.0, no_hold, options), std::invalid_argument);
  options = {};
  options.cells = 1e300;
  EXPECT_THROW(simulate(heated_zone(), drivers, 900.0, no_hold, options), std::invalid_argument);
}

}  // namespace
}  // namespace amiss::zone
