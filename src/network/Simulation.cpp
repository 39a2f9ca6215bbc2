#include "network/Simulation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "network/RowPropagators.hpp"

namespace amiss::network {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kBlock = 256;

// The state, and its slopes along directions.
struct State {
  VectorXd x;
  MatrixXd slopes;
};

bool is_held(const Eigen::Ref<const VectorXd>& hold, Index row) {
  return hold.size() > 0 && !std::isnan(hold[row]);
}

VectorXd drivers_before(const Coefficients& coefficients, const Eigen::Ref<const MatrixXd>& drivers,
                        const Options& options) {
  const Index rows = std::clamp<Index>(std::lround(options.start_hours / options.step_h), 1, drivers.rows());
  const VectorXd mean = drivers.topRows(rows).colwise().mean();
  VectorXd before = coefficients.before;
  for (Index j = 0; j < before.size(); ++j) before[j] = std::isnan(before[j]) ? mean[j] : before[j];
  return before;
}

// Steady state of the nodes without a start: 0 = A x + B u in their rows, the others given.
class SteadyStart {
 public:
  SteadyStart(const Network& network, const Coefficients& coefficients, VectorXd before, VectorXd given,
              double fastest)
      : network_(network),
        coefficients_(coefficients),
        before_(std::move(before)),
        fastest_(fastest),
        balance_(balance(network, coefficients, before_, fastest)),
        x_(std::move(given)) {
    for (Index i = 0; i < x_.size(); ++i) {
      if (std::isnan(x_[i])) {
        free_.push_back(static_cast<int>(i));
        x_[i] = 0.0;
      }
    }
    if (free_.empty()) return;
    const auto count = static_cast<Index>(free_.size());
    MatrixXd among(count, count);
    for (Index i = 0; i < count; ++i) {
      for (Index j = 0; j < count; ++j) among(i, j) = balance_.states(free_[i], free_[j]);
    }
    solver_.compute(among);
    if (!solver_.isInvertible()) {
      x_.setConstant(std::numeric_limits<double>::quiet_NaN());
      return;
    }
    x_ += spread(balance_.states * x_ + balance_.inputs * with_one(before_));
  }

  State state(const std::vector<Coefficients>& directions) const {
    State out{x_, MatrixXd(x_.size(), static_cast<Index>(directions.size()))};
    for (std::size_t p = 0; p < directions.size(); ++p)
      out.slopes.col(static_cast<Index>(p)) = slope(directions[p]);
    return out;
  }

 private:
  VectorXd slope(const Coefficients& direction) const {
    VectorXd out = direction.start;
    for (const int i : free_) out[i] = 0.0;
    if (free_.empty() || !solver_.isInvertible()) return out;
    const Balance change = derivative(network_, coefficients_, direction, before_, fastest_);
    VectorXd moved = VectorXd::Zero(before_.size() + 1);
    moved.head(before_.size()) = direction.before;
    return out + spread(change.states * x_ + change.inputs * with_one(before_) + balance_.states * out +
                        balance_.inputs * moved);
  }

  static VectorXd with_one(const VectorXd& u) {
    VectorXd out(u.size() + 1);
    out << u, 1.0;
    return out;
  }

  // What the free nodes add so that what is left of their balance becomes zero.
  VectorXd spread(const VectorXd& left) const {
    VectorXd right(static_cast<Index>(free_.size()));
    for (Index i = 0; i < right.size(); ++i) right[i] = -left[free_[i]];
    const VectorXd found = solver_.solve(right);
    VectorXd out = VectorXd::Zero(left.size());
    for (Index i = 0; i < right.size(); ++i) out[free_[i]] = found[i];
    return out;
  }

  const Network& network_;
  const Coefficients& coefficients_;
  VectorXd before_;
  double fastest_;
  Balance balance_;
  VectorXd x_;
  std::vector<int> free_;
  Eigen::ColPivHouseholderQR<MatrixXd> solver_;
};

// Inputs of some rows, one a column: drivers and the constant one at the start of the row, and what they gain
// over it.
class Inputs {
 public:
  Inputs(const Eigen::Ref<const MatrixXd>& drivers, bool linear)
      : drivers_(drivers), linear_(linear), block_((linear ? 2 : 1) * (drivers.cols() + 1), kBlock) {
    block_.setZero();
    block_.row(drivers.cols()).setOnes();
  }

  Index size() const { return block_.rows(); }
  Index rows() const { return drivers_.rows(); }

  /// The first of them are rows from, from + 1, ..., `count` at most.
  const MatrixXd& of(Index from, Index count) {
    const Index m = drivers_.cols();
    for (Index k = 0; k < m; ++k) {
      if (linear_) {
        double before = drivers_(std::max<Index>(from - 1, 0), k);
        for (Index j = 0; j < count; ++j) {
          const double now = drivers_(from + j, k);
          block_(k, j) = before;
          block_(m + 1 + k, j) = now - before;
          before = now;
        }
      } else {
        for (Index j = 0; j < count; ++j) block_(k, j) = drivers_(from + j, k);
      }
    }
    return block_;
  }

 private:
  Eigen::Ref<const MatrixXd> drivers_;
  bool linear_;
  MatrixXd block_;
};

// x_{j+1} = A x_j + B u_j, y_j = c x_j + d u_j for [A B; c d] = p and the first `rows` columns of `inputs`;
// of n states, unrolled if they are few. Each row waits for the one before: its products are summed in two
// chains, which run side by side.
template <int n>
void recur(const Eigen::Ref<const MatrixXd>& p, const MatrixXd& inputs, Index rows, VectorXd& state,
           double* output) {
  const Index high = n == Eigen::Dynamic ? state.size() : n;
  const Eigen::Matrix<double, n, n> a = p.topLeftCorner(high, high);
  const Eigen::Matrix<double, n, Eigen::Dynamic> b = p.topRightCorner(high, inputs.rows());
  const Eigen::Matrix<double, 1, n> c = p.row(high).head(high);
  const Eigen::RowVectorXd d = p.row(high).tail(inputs.rows());
  Eigen::Matrix<double, n, 1> x = state, even(high), odd(high);
  for (Index j = 0; j < rows; ++j) {
    even.setZero();
    double y = 0.0;
    for (Index k = 0; k < b.cols(); ++k) {
      even += b.col(k) * inputs(k, j);
      y += d[k] * inputs(k, j);
    }
    output[j] = y + c.dot(x);
    odd.setZero();
    for (Index k = 0; k < high; k += 2) even += a.col(k) * x[k];
    for (Index k = 1; k < high; k += 2) odd += a.col(k) * x[k];
    x = even + odd;
  }
  state = x;
}

using Recursion = void (*)(const Eigen::Ref<const MatrixXd>&, const MatrixXd&, Index, VectorXd&, double*);

Recursion recursion_of(Index nodes) {
  static const Recursion known[] = {recur<1>, recur<2>, recur<3>, recur<4>,
                                    recur<5>, recur<6>, recur<7>, recur<8>};
  return nodes <= 8 ? known[nodes - 1] : recur<Eigen::Dynamic>;
}

// Goes through the rows, some hundred at a time.
class Stepper {
 public:
  Stepper(RowPropagators& propagators, Inputs inputs, Index nodes, Index directions)
      : propagators_(propagators), inputs_(std::move(inputs)), nodes_(nodes), directions_(directions) {}

  /// Takes the state over rows [from, to), asked for in ascending order, and writes output and slopes there.
  void run(State& state, Index from, Index to, Run& run) {
    if (propagators_.same() && directions_ == 0) {
      const auto p = propagators_.at(from);
      const Recursion recursion = recursion_of(nodes_);
      for (Index first = from; first < to; first += kBlock) {
        const Index count = std::min(kBlock, to - first);
        recursion(p, inputs_.of(first, count), count, state.x, run.output.data() + first);
      }
    } else {
      for (Index r = from; r < to; ++r) step(state, r, run);
    }
  }

 private:
  void step(State& state, Index r, Run& run) {
    const auto p = propagators_.at(r);
    const Index high = nodes_ + 1;
    if (r >= end_) read(p, r);
    if (propagators_.same()) {
      moved_ = forcing_.col(r - first_);
    } else {
      moved_.noalias() = p.rightCols(inputs_.size()) * block_->col(r - first_);
    }
    moved_.noalias() += p.leftCols(nodes_) * state.x;
    Eigen::Map<MatrixXd> all(moved_.data(), high, 1 + directions_);
    if (directions_ > 0) {
      all.rightCols(directions_).noalias() += p.topLeftCorner(high, nodes_) * state.slopes;
      state.slopes = all.topRightCorner(nodes_, directions_);
      run.slopes.row(r) = all.row(nodes_).tail(directions_);
    }
    state.x = moved_.head(nodes_);
    run.output[r] = moved_[nodes_];
  }

  // Inputs of the next rows and, if propagators are the same, what they bring to each quantity, a row a
  // column.
  void read(const Eigen::Map<const MatrixXd>& p, Index from) {
    first_ = from;
    end_ = std::min(from + kBlock, inputs_.rows());
    block_ = &inputs_.of(from, end_ - from);
    if (propagators_.same()) forcing_.noalias() = p.rightCols(inputs_.size()) * block_->leftCols(end_ - from);
  }

  RowPropagators& propagators_;
  Inputs inputs_;
  Index nodes_, directions_;
  const MatrixXd* block_ = nullptr;
  Index first_ = 0, end_ = 0;
  MatrixXd forcing_;
  VectorXd moved_;
};

void check_sizes(const Network& network, const Coefficients& c, const Eigen::Ref<const MatrixXd>& drivers,
                 const Eigen::Ref<const VectorXd>& hold) {
  if (c.element.size() != network.elements || c.capacity.size() != network.nodes ||
      c.start.size() != network.nodes || c.before.size() != network.drivers) {
    throw std::invalid_argument("network: coefficients of another size");
  }
  if (drivers.cols() != network.drivers || drivers.rows() < 1) {
    throw std::invalid_argument("network: drivers of another size");
  }
  if (hold.size() != 0 && hold.size() != drivers.rows()) {
    throw std::invalid_argument("network: hold needs a number for each row");
  }
}

}  // namespace

void Options::check() const {
  if (!(step_h > 0.0) || !std::isfinite(step_h))
    throw std::invalid_argument("network: step_h must be above 0");
  if (!(start_hours >= 0.0)) throw std::invalid_argument("network: start_hours must be 0 or more");
}

Run simulate(const Network& network, const Coefficients& coefficients,
             const std::vector<Coefficients>& directions, const Eigen::Ref<const MatrixXd>& drivers,
             const Eigen::Ref<const VectorXd>& hold, const Options& options) {
  network.check();
  options.check();
  check_sizes(network, coefficients, drivers, hold);
  const int output_node = network.output_node();
  const Eigen::Ref<const VectorXd> holds = output_node < 0 ? hold.head(0) : hold.head(hold.size());
  VectorXd given = coefficients.start;
  if (output_node >= 0 && std::isnan(given[output_node]) && is_held(holds, 0)) given[output_node] = holds[0];
  State state = SteadyStart(network, coefficients, drivers_before(coefficients, drivers, options), given,
                            1e5 / options.step_h)
                    .state(directions);
  const auto count = static_cast<Index>(directions.size());
  Row row{options.step_h, options.linear, options.mean, -1};
  RowPropagators free(network, coefficients, directions, drivers, row);
  Stepper freely(free, {drivers, options.linear}, network.nodes, count);
  row.held = output_node;
  std::optional<RowPropagators> held;
  std::optional<Stepper> holding;
  Run run{VectorXd(drivers.rows()), MatrixXd(drivers.rows(), count)};
  for (Index r = 0; r < drivers.rows();) {
    if (!is_held(holds, r)) {
      Index to = r + 1;
      while (to < drivers.rows() && !is_held(holds, to)) ++to;
      freely.run(state, r, to, run);
      r = to;
      continue;
    }
    if (!holding) {
      held.emplace(network, coefficients, directions, drivers, row);
      holding.emplace(*held, Inputs(drivers, options.linear), network.nodes, count);
    }
    state.x[output_node] = holds[r];
    state.slopes.row(output_node).setZero();
    holding->run(state, r, r + 1, run);
    ++r;
  }
  return run;
}

}  // namespace amiss::network
