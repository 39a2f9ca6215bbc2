#include "engine/optimise/maximise.hpp"

#include <nlopt.h>

#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>

namespace amiss {
namespace {

struct Search {
  const Objective* objective;
  Maximum best;
  std::exception_ptr failure;
};

double call(unsigned n, const double* x, double* gradient, void* data) {
  auto& search = *static_cast<Search*>(data);
  const Eigen::VectorXd point = Eigen::Map<const Eigen::VectorXd>(x, n);
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(n);
  double value = -std::numeric_limits<double>::infinity();
  try {
    value = (*search.objective)(point, slope);
  } catch (...) {
    search.failure = std::current_exception();
  }
  ++search.best.evaluations;
  if (value > search.best.value) {
    search.best.value = value;
    search.best.x = point;
  }
  if (gradient != nullptr) Eigen::Map<Eigen::VectorXd>(gradient, n) = slope;
  return std::isfinite(value) ? value : -1e300;
}

}  // namespace

Maximum maximise(const Objective& objective, const Eigen::VectorXd& start, const Eigen::VectorXd& lower,
                 const Eigen::VectorXd& upper, double tolerance, int max_evaluations) {
  if ((lower.array() > upper.array()).any())
    throw std::invalid_argument("maximise: a lower bound exceeds its upper bound");
  Search search{&objective, {start, -std::numeric_limits<double>::infinity(), 0, false}, nullptr};
  const std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)> optimiser(
      nlopt_create(NLOPT_LD_LBFGS, static_cast<unsigned>(start.size())), nlopt_destroy);
  if (!optimiser) throw std::runtime_error("NLopt could not be started");
  nlopt_set_lower_bounds(optimiser.get(), lower.data());
  nlopt_set_upper_bounds(optimiser.get(), upper.data());
  nlopt_set_max_objective(optimiser.get(), call, &search);
  nlopt_set_ftol_rel(optimiser.get(), tolerance);
  nlopt_set_xtol_rel(optimiser.get(), 1e-7);
  nlopt_set_maxeval(optimiser.get(), max_evaluations);
  Eigen::VectorXd x = start.cwiseMax(lower).cwiseMin(upper);
  double value = 0.0;
  // NLopt also reports failure when rounding stops the line search close to the optimum: the best point
  // stands.
  const nlopt_result status = nlopt_optimize(optimiser.get(), x.data(), &value);
  if (search.failure) std::rethrow_exception(search.failure);
  search.best.converged = status != NLOPT_MAXEVAL_REACHED;
  return search.best;
}

}  // namespace amiss
