#include <limits>

#include "zone/Airflow.hpp"
#include "zone/air.hpp"
#include "zone/wind.hpp"
#include "zone_helpers.hpp"

namespace amiss::zone {
namespace {

using namespace test;

TEST(Airflow, FlowsBetweenTwoHeightsMatchTheStackFormula) {
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

TEST(Airflow, MassBalanceClosesInWind) {
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

TEST(Airflow, CrackFollowsItsPowerLaw) {
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

TEST(Airflow, OneOpeningExchangesNothing) {
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

TEST(Airflow, PressureCoefficientsAreTheTableAtItsNodes) {
  const double exposed[] = {0.70, 0.525, 0.35, -0.075, -0.50, -0.45, -0.40, -0.30, -0.20};
  const double semi[] = {0.40, 0.25, 0.10, -0.10, -0.30, -0.325, -0.35, -0.275, -0.20};
  const double sheltered[] = {0.20, 0.125, 0.05, -0.10, -0.25, -0.275, -0.30, -0.275, -0.25};
  for (int i = 0; i < 9; ++i) {
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::exposed, 22.5 * i), exposed[i]);
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::semi_exposed, 22.5 * i), semi[i]);
    EXPECT_DOUBLE_EQ(pressure_coefficient(Exposure::sheltered, 22.5 * i), sheltered[i]);
  }
}

TEST(Airflow, PressureCoefficientIsSmooth) {
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

TEST(Airflow, PressureCoefficientStaysBetweenItsNodes) {
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

TEST(Airflow, IncidenceAngleWrapsAroundNorth) {
  EXPECT_DOUBLE_EQ(incidence_angle(350.0, 10.0), 20.0);
  EXPECT_DOUBLE_EQ(incidence_angle(10.0, 350.0), 20.0);
  EXPECT_DOUBLE_EQ(incidence_angle(270.0, 90.0), 180.0);
}

TEST(Airflow, FacadeWindIsContinuousAndWeakInTheLee) {
  EXPECT_DOUBLE_EQ(facade_wind(4.0, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(facade_wind(4.0, 45.0), 4.0 * std::sqrt(0.5));
  EXPECT_NEAR(facade_wind(4.0, 135.0), std::sqrt(0.5), 1e-12);
  for (double angle = 0.0; angle < 179.9; angle += 0.1) {
    EXPECT_NEAR(facade_wind(1.0, angle), facade_wind(1.0, angle + 0.1), 0.01);
  }
}

}  // namespace
}  // namespace amiss::zone
