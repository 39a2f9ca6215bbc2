#include "network/Simulation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "network/Chebyshev.hpp"

namespace {

using namespace amiss::network;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const VectorXd kFree;  // nothing is held

void add_link(Network& network, Place a, Place b, int element, int by = -1) {
  if (a.node >= 0) {
    network.balance.push_back({a.node, b, 1.0, element, by});
    network.balance.push_back({a.node, a, -1.0, element, by});
  }
  if (b.node >= 0) {
    network.balance.push_back({b.node, a, 1.0, element, by});
    network.balance.push_back({b.node, b, -1.0, element, by});
  }
}

// One node that a conductance of 0.2 joins to driver 0.
struct OneNode {
  OneNode() {
    network.nodes = network.elements = network.drivers = 1;
    add_link(network, {0, -1}, {-1, 0}, 0);
    network.output.push_back({-1, {0, -1}, 1.0, -1, -1});
  }
  Network network;
  Coefficients coefficients{VectorXd::Constant(1, 0.2), VectorXd::Constant(1, 3.0),
                            VectorXd::Constant(1, 20.0), VectorXd::Constant(1, kNaN)};
};

// Air, wall and heater; outdoor air, sun, heating and wind, of which wind multiplies a leak.
struct House {
  explicit House(bool windy) {
    network.nodes = 3;
    network.elements = 6;
    network.drivers = 4;
    add_link(network, {0, -1}, {1, -1}, 0);
    add_link(network, {1, -1}, {-1, 0}, 1);
    add_link(network, {0, -1}, {2, -1}, 2);
    add_link(network, {0, -1}, {-1, 0}, 3, windy ? 3 : -1);
    network.balance.push_back({0, {-1, 1}, 1.0, 4, -1});
    network.balance.push_back({2, {-1, 2}, 1.0, 5, -1});
    network.output.push_back({-1, {0, -1}, 1.0, -1, -1});
    coefficients.element.resize(6);
    coefficients.element << 0.8, 0.15, 1.5, 0.03, 0.004, 1.0;
    coefficients.capacity.resize(3);
    coefficients.capacity << 0.7, 5.0, 0.4;
    coefficients.start.resize(3);
    coefficients.start << kNaN, kNaN, 30.0;
    coefficients.before.resize(4);
    coefficients.before << 8.0, kNaN, kNaN, kNaN;
    drivers.resize(60, 4);
    for (Index r = 0; r < drivers.rows(); ++r) {
      const double t = static_cast<double>(r);
      drivers.row(r) << 6 + 4 * std::sin(t / 4), std::max(0.0, 300 * std::cos(t / 5)), r % 7 < 3 ? 2.0 : 0.0,
          2 + 1.5 * std::sin(1 + t / 3);
    }
  }
  Network network;
  Coefficients coefficients;
  MatrixXd drivers;
};

Options hourly(bool linear, bool mean, double step_h = 1.0) {
  Options options;
  options.linear = linear;
  options.mean = mean;
  options.step_h = step_h;
  options.start_hours = 6 * step_h;
  return options;
}

Coefficients zero_like(const Coefficients& like) {
  return {VectorXd::Zero(like.element.size()), VectorXd::Zero(like.capacity.size()),
          VectorXd::Zero(like.start.size()), VectorXd::Zero(like.before.size())};
}

// The same by the classical Runge-Kutta method in many small steps within each row, its mean by Simpson's
// rule.
VectorXd by_runge_kutta(const House& house, const Options& options, VectorXd x, int pieces) {
  VectorXd out(house.drivers.rows());
  const double h = options.step_h / pieces;
  for (Index r = 0; r < out.size(); ++r) {
    const VectorXd end = house.drivers.row(r);
    const VectorXd begin = options.linear ? house.drivers.row(std::max<Index>(r - 1, 0)).transpose() : end;
    const auto rate = [&](double share, const VectorXd& state) -> VectorXd {
      VectorXd inputs(5);
      inputs << begin + share * (end - begin), 1.0;
      const Balance at = balance(house.network, house.coefficients, end, 1e12);
      return at.states * state + at.inputs * inputs;
    };
    double sum = 0.0;
    for (int i = 0; i < pieces; ++i) {
      const double from = static_cast<double>(i) / pieces, to = static_cast<double>(i + 1) / pieces;
      const VectorXd k1 = rate(from, x), k2 = rate((from + to) / 2, x + h / 2 * k1);
      const VectorXd k3 = rate((from + to) / 2, x + h / 2 * k2), k4 = rate(to, x + h * k3);
      const VectorXd next = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      const double middle = 0.5 * (x[0] + next[0]) + h / 8 * (k1[0] - rate(to, next)[0]);
      sum += (x[0] + 4 * middle + next[0]) / 6;
      x = next;
    }
    out[r] = options.mean ? sum / pieces : x[0];
  }
  return out;
}

TEST(Network, OneNodeFollowsAStepByItsClosedForm) {
  OneNode one;
  const MatrixXd drivers = MatrixXd::Constant(40, 1, 5.0);
  const double rate = 0.2 / 3.0, step = 0.5;
  const auto end = simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(false, false, step));
  const auto mean = simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(false, true, step));
  for (Index r = 0; r < 40; ++r) {
    const double t = step * static_cast<double>(r);
    const double from = 5 + 15 * std::exp(-rate * t), to = 5 + 15 * std::exp(-rate * (t + step));
    EXPECT_NEAR(end.output[r], to, 1e-12);
    EXPECT_NEAR(mean.output[r], 5 + (from - to) / (rate * step), 1e-12);
  }
}

TEST(Network, OneNodeFollowsALineByItsClosedForm) {
  OneNode one;
  one.coefficients.start[0] = 0.0;
  MatrixXd drivers(30, 1);
  for (Index r = 0; r < 30; ++r)
    drivers(r, 0) = static_cast<double>(r);  // u = t - 1 from the first row's end on
  const auto run = simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(true, false));
  const double rate = 0.2 / 3.0;
  for (Index r = 1; r < 30; ++r) {  // x' = rate (s - x), x(0) = 0
    const double s = static_cast<double>(r);
    EXPECT_NEAR(run.output[r], s - (1 - std::exp(-rate * s)) / rate, 1e-11);
  }
}

TEST(Network, AgreesWithSmallStepsOfRungeKutta) {
  for (const bool windy : {false, true}) {
    for (const bool linear : {false, true}) {
      for (const bool mean : {false, true}) {
        House house(windy);
        house.coefficients.start << 19.0, 14.0, 30.0;
        const Options options = hourly(linear, mean);
        const auto run = simulate(house.network, house.coefficients, {}, house.drivers, kFree, options);
        const VectorXd other = by_runge_kutta(house, options, house.coefficients.start, 200);
        // Steps of 1/200 h against a fastest rate of 5.3 / h: (5.3 / 200)^4 is 5e-7 of a change of some
        // kelvins.
        EXPECT_LT((run.output - other).cwiseAbs().maxCoeff(), 1e-7) << windy << linear << mean;
      }
    }
  }
}

TEST(Network, SlopesAreThoseOfCentralDifferences) {
  for (const bool windy : {false, true}) {
    for (const bool linear : {false, true}) {
      for (const bool mean : {false, true}) {
        House house(windy);
        VectorXd hold = VectorXd::Constant(60, kNaN);
        for (Index r = 0; r < 5; ++r) hold[r] = 20.0 + 0.1 * static_cast<double>(r);
        std::vector<Coefficients> directions;
        for (int i = 0; i < 6; ++i)
          directions.push_back(zero_like(house.coefficients)), directions.back().element[i] = 1;
        for (int i = 0; i < 3; ++i)
          directions.push_back(zero_like(house.coefficients)), directions.back().capacity[i] = 1;
        directions.push_back(zero_like(house.coefficients)), directions.back().start[2] = 1;
        directions.push_back(zero_like(house.coefficients)), directions.back().before[0] = 1;
        const Options options = hourly(linear, mean);
        const auto run =
            simulate(house.network, house.coefficients, directions, house.drivers, hold, options);
        for (std::size_t p = 0; p < directions.size(); ++p) {
          const auto moved = [&](double by) {
            Coefficients c = house.coefficients;
            c.element += by * directions[p].element;
            c.capacity += by * directions[p].capacity;
            c.start += by * directions[p].start;
            c.before += by * directions[p].before;
            return simulate(house.network, c, {}, house.drivers, hold, options).output;
          };
          const double by = 1e-5;
          const VectorXd differences = (moved(by) - moved(-by)) / (2 * by);
          const VectorXd slope = run.slopes.col(static_cast<Index>(p));
          EXPECT_GT(slope.norm(), 0.0) << p;
          // Rounding of 1e-13 over 2e-5, and the third derivative times 1e-10 / 6.
          EXPECT_LT((slope - differences).cwiseAbs().maxCoeff(), 1e-6 * (1 + slope.cwiseAbs().maxCoeff()))
              << p;
        }
      }
    }
  }
}

TEST(Network, SlopesOfAFlowAndAfterAHoldAreThoseOfDifferences) {
  House house(false);
  house.coefficients.start << 19.0, 14.0, 30.0;
  Network flow = house.network;  // from the air to the wall
  flow.output = {{-1, {0, -1}, 1.0, 0, -1}, {-1, {1, -1}, -1.0, 0, -1}};
  VectorXd hold = VectorXd::Constant(60, kNaN);
  hold.segment(20, 5).setConstant(21.0);
  Coefficients direction = zero_like(house.coefficients);
  direction.element[0] = 1;
  for (const Network& network : {flow, house.network}) {
    for (const bool mean : {false, true}) {
      const Options options = hourly(true, mean);
      const auto run = simulate(network, house.coefficients, {direction}, house.drivers, hold, options);
      const auto moved = [&](double by) {
        Coefficients c = house.coefficients;
        c.element[0] += by;
        return simulate(network, c, {}, house.drivers, hold, options).output;
      };
      const VectorXd differences = (moved(1e-5) - moved(-1e-5)) / 2e-5;
      // As above: rounding over 2e-5.
      EXPECT_LT((run.slopes.col(0) - differences).cwiseAbs().maxCoeff(),
                1e-6 * (1 + differences.cwiseAbs().maxCoeff()));
    }
  }
}

TEST(Network, ASecondModulatorChangesNothing) {
  House house(true);
  const auto series =
      simulate(house.network, house.coefficients, {}, house.drivers, kFree, hourly(false, true));
  Network two = house.network;
  two.drivers = 5;
  for (Term& term : two.balance) {
    if (term.element == 1) term.by = 4;
  }
  Coefficients c = house.coefficients;
  c.before.conservativeResize(5);
  c.before[4] = 1.0;
  MatrixXd drivers = MatrixXd::Ones(60, 5);
  drivers.leftCols(4) = house.drivers;
  const auto each = simulate(two, c, {}, drivers, kFree, hourly(false, true));
  EXPECT_LT((series.output - each.output).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Network, ConservesWhatItHolds) {
  House house(false);
  house.coefficients.start << 19.0, 14.0, 30.0;
  // All that crosses the border, as the output: both links to outdoors, sun and heating.
  Network border = house.network;
  border.output.clear();
  for (const int element : {1, 3}) {
    border.output.push_back({-1, {-1, 0}, 1.0, element, -1});
    border.output.push_back({-1, {element == 1 ? 1 : 0, -1}, -1.0, element, -1});
  }
  border.output.push_back({-1, {-1, 1}, 1.0, 4, -1});
  border.output.push_back({-1, {-1, 2}, 1.0, 5, -1});
  const Options options = hourly(true, true);
  const double crossed = simulate(border, house.coefficients, {}, house.drivers, kFree, options).output.sum();
  double stored = 0.0;
  for (int node = 0; node < 3; ++node) {
    Network at = house.network;
    at.output[0].of.node = node;
    const auto run = simulate(at, house.coefficients, {}, house.drivers, kFree, hourly(true, false));
    stored += house.coefficients.capacity[node] * (run.output[59] - house.coefficients.start[node]);
  }
  EXPECT_NEAR(crossed, stored, 1e-9 * std::abs(crossed));
}

TEST(Network, ANodeWithoutCapacityPassesHeatOn) {
  House house(false);
  house.coefficients.start << 19.0, 14.0, kNaN;
  house.coefficients.capacity[2] = 0.0;
  const auto run = simulate(house.network, house.coefficients, {}, house.drivers, kFree, hourly(false, true));
  Network without = house.network;
  for (Term& term : without.balance) {
    if (term.element == 5) term.into = 0;  // its heating goes to the air
    if (term.element == 2) term.element = 0, term.of = {1, -1}, term.into = 1, term.sign = 0.0;
  }
  Coefficients c = house.coefficients;
  c.capacity[2] = 1.0;
  c.start[2] = 0.0;
  const auto other = simulate(without, c, {}, house.drivers, kFree, hourly(false, true));
  EXPECT_LT((run.output - other.output).cwiseAbs().maxCoeff(), 1e-3);  // the fastest node takes 1e-5 of a row
}

TEST(Network, IsHeldAndGoesOnFromThere) {
  House house(false);
  VectorXd hold = VectorXd::Constant(60, kNaN);
  hold.head(10).setConstant(24.0);
  const auto run = simulate(house.network, house.coefficients, {}, house.drivers, hold, hourly(false, false));
  for (Index r = 0; r < 10; ++r) EXPECT_NEAR(run.output[r], 24.0, 1e-12);
  EXPECT_LT(std::abs(run.output[10] - 24.0), 3.0);
  EXPECT_NE(run.output[10], 24.0);
}

// Rows are taken some hundred at a time, and one by one if slopes are asked for. Both give the same across
// the ends of these blocks, with rows held there.
TEST(Network, LongRunsAreTheSameWithSlopes) {
  House house(false);
  const Index rows = 600;
  const MatrixXd drivers = house.drivers.replicate(10, 1);
  VectorXd held = VectorXd::Constant(rows, kNaN);
  held.segment(254, 4).setConstant(24.0);
  held.tail(3).setConstant(22.0);
  for (const bool linear : {false, true}) {
    for (const VectorXd& hold : {kFree, held}) {
      const Options options = hourly(linear, true);
      const VectorXd plain = simulate(house.network, house.coefficients, {}, drivers, hold, options).output;
      const VectorXd stepped =
          simulate(house.network, house.coefficients, {house.coefficients}, drivers, hold, options).output;
      EXPECT_LT((plain - stepped).cwiseAbs().maxCoeff(), 1e-10);
      // The first rows do not know how long the record is.
      const VectorXd start = simulate(house.network, house.coefficients, {}, drivers.topRows(100),
                                      hold.head(std::min<Index>(100, hold.size())), options)
                                 .output;
      EXPECT_LT((plain.head(100) - start).cwiseAbs().maxCoeff(), 1e-10);
    }
  }
}

TEST(Network, StaysWhereItIsInSteadyState) {
  House house(true);
  house.drivers.rowwise() = house.drivers.row(2).eval();
  house.coefficients.start.setConstant(kNaN);
  house.coefficients.before.setConstant(kNaN);
  const auto run = simulate(house.network, house.coefficients, {}, house.drivers, kFree, hourly(true, true));
  EXPECT_LT((run.output.array() - run.output[0]).abs().maxCoeff(), 1e-9);
}

TEST(Network, AnInfiniteCapacityIsAConstant) {
  OneNode one;
  Network two = one.network;
  two.nodes = 2;
  two.balance.clear();
  add_link(two, {0, -1}, {1, -1}, 0);
  Coefficients c = one.coefficients;
  c.capacity = VectorXd::Constant(2, 3.0);
  c.capacity[1] = std::numeric_limits<double>::infinity();
  c.start = VectorXd::Constant(2, 20.0);
  c.start[1] = 5.0;
  const MatrixXd drivers = MatrixXd::Constant(30, 1, 5.0);
  const auto constant = simulate(two, c, {}, drivers, kFree, hourly(false, true));
  const auto driven = simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(false, true));
  EXPECT_LT((constant.output - driven.output).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Network, HasNoSteadyStateWithoutALoss) {
  OneNode one;
  one.network.balance = {{0, {-1, 0}, 1.0, 0, -1}};
  one.coefficients.start[0] = kNaN;
  const MatrixXd drivers = MatrixXd::Ones(5, 1);
  EXPECT_FALSE(
      simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(false, true)).output.allFinite());
  one.coefficients.start[0] = 1.0;
  const auto run = simulate(one.network, one.coefficients, {}, drivers, kFree, hourly(false, false));
  EXPECT_NEAR(run.output[4], 1.0 + 5 * 0.2 / 3.0, 1e-13);
}

TEST(Network, RefusesWhatLeadsNowhere) {
  const MatrixXd drivers = MatrixXd::Ones(5, 1);
  const auto run = [&](const OneNode& one, const Options& options = Options()) {
    return simulate(one.network, one.coefficients, {}, drivers, kFree, options);
  };
  OneNode one;
  one.network.balance[0].of.driver = 1;
  EXPECT_THROW(run(one), std::invalid_argument);
  one = OneNode();
  one.network.output.clear();
  EXPECT_THROW(run(one), std::invalid_argument);
  one = OneNode();
  one.coefficients.element.resize(2);
  EXPECT_THROW(run(one), std::invalid_argument);
  one = OneNode();
  Options options;
  options.step_h = 0.0;
  EXPECT_THROW(run(one, options), std::invalid_argument);
}

TEST(Chebyshev, SeriesOfAnExponentialIsExact) {
  const Chebyshev series(-1.0, 3.0, [](double x) { return VectorXd::Constant(2, std::exp(-2 * x)); });
  ASSERT_TRUE(series.converged());
  const VectorXd at = VectorXd::LinSpaced(50, -1.0, 3.0);
  const auto found = series(at);
  for (Index i = 0; i < 50; ++i)
    EXPECT_NEAR(found(i, 1), std::exp(-2 * at[i]), 1e-11);  // of a largest value of 7.4
}

TEST(Chebyshev, SaysThatAJumpDoesNotConverge) {
  const Chebyshev series(-1.0, 1.0, [](double x) { return VectorXd::Constant(1, x > 0.1 ? 1.0 : 0.0); });
  EXPECT_FALSE(series.converged());
}

}  // namespace
