#include <limits>
#include <numeric>

#include "engine/parallel/parallel_for.hpp"
#include "zone/air.hpp"
#include "zone_helpers.hpp"

namespace amiss::zone {
namespace {

using namespace test;

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

}  // namespace
}  // namespace amiss::zone
