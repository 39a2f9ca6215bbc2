#include <complex>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "zone/air.hpp"
#include "zone_helpers.hpp"

namespace amiss::zone {
namespace {

using namespace test;

using Complex = std::complex<double>;

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

// What a wall gives to the room is what came through its outer side and is not stored.
TEST(Zone, FluxOfAWallClosesItsBalance) {
  const double step = 900.0;
  const MatrixXd drivers = lively_drivers(300);
  Zone zone = heated_zone();
  Options options;
  options.flux_wall = 0;
  const auto run = simulate(zone, drivers, step, no_hold, options);
  ASSERT_EQ(run.flux.size(), 300);
  const double given = run.flux.sum() * zone.walls[0].area * step;
  EXPECT_NEAR(given, run.balance.through[0] - run.balance.stored_walls, 1e-9 * std::abs(given));
  EXPECT_EQ(simulate(zone, drivers, step, no_hold, {}).flux.size(), 0);
  EXPECT_EQ(run.air, simulate(zone, drivers, step, no_hold, {}).air);
}

TEST(Zone, FluxIsThatOfTheWallAskedFor) {
  const MatrixXd drivers = lively_drivers(300);
  const Zone zone = everything();
  Zone swapped = zone;
  std::swap(swapped.walls[0], swapped.walls[1]);
  Options first, second;
  first.flux_wall = 0;
  second.flux_wall = 1;
  const VectorXd facade = simulate(zone, drivers, 900.0, no_hold, first).flux,
                 mass = simulate(zone, drivers, 900.0, no_hold, second).flux;
  EXPECT_GT((facade - mass).cwiseAbs().maxCoeff(), 1.0);
  // The order of the walls changes the order of sums alone.
  EXPECT_LT((simulate(swapped, drivers, 900.0, no_hold, second).flux - facade).cwiseAbs().maxCoeff(), 1e-8);
  first.flux_wall = 2;
  EXPECT_THROW(simulate(zone, drivers, 900.0, no_hold, first), std::invalid_argument);
}

}  // namespace
}  // namespace amiss::zone
