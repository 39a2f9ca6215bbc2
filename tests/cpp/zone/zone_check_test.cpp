#include <limits>
#include <stdexcept>
#include <string>

#include "zone_helpers.hpp"

namespace amiss::zone {
namespace {

using namespace test;

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
