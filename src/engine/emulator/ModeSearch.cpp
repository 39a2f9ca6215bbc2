#include "engine/emulator/ModeSearch.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/optimise/maximise.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLogNugget = -9.0, kLogitBeta = 3.5;  // of a nearly linear response, where searches start

// A point in the coordinates of log_density() with shared betas, and who shares them.
struct Point {
  std::vector<int> beta_of;
  Maximum at;
};

class Search {
 public:
  Search(const MatrixXd& inputs, const VectorXd& values, const HyperPriors& priors,
         const SearchOptions& options)
      : inputs_(inputs), values_(values), priors_(priors), options_(options) {}

  Mode run() {
    std::vector<int> beta_of(static_cast<std::size_t>(inputs_.cols()), 0);
    if (!options_.forward) std::iota(beta_of.begin(), beta_of.end(), 0);
    Point best = search_starts(beta_of);
    if (!std::isfinite(best.at.value))
      throw std::runtime_error("emulator: no usable hyper-parameters were found");
    if (options_.forward) select(best);
    GaussianProcessParameters parameters = GaussianProcessParameters::unpack(best.at.x);
    parameters.logit_beta.resize(inputs_.cols());
    for (Index p = 0; p < inputs_.cols(); ++p) parameters.logit_beta[p] = best.at.x[3 + best.beta_of[p]];
    return {parameters, best.at.value, evaluations_, selection_, best.beta_of};
  }

 private:
  // From nearly linear to rough responses; the same beta for all.
  std::vector<VectorXd> starting_points(Index n_betas) const {
    const GammaPrior& lambda = priors_.lambda;
    const double mode = lambda.shape > 1 ? std::log((lambda.shape - 1) / lambda.rate) : 10.0;
    const double log_lambda = std::min(std::max(mode, kLower[2]), kUpper[2]);
    std::vector<VectorXd> points;
    for (int s = 0; s < options_.starts; ++s) {
      VectorXd x = VectorXd::Constant(3 + n_betas, kLogitBeta - 5.0 * s / std::max(1, options_.starts - 1));
      x.head(3) << (s == 0 ? 3.0 : 1.0), kLogNugget, lambda.shape > 0 ? log_lambda : kUpper[2];
      points.push_back(x);
    }
    return points;
  }

  Point search_starts(const std::vector<int>& beta_of) {
    const Objective density = objective(beta_of);
    std::vector<Maximum> candidates;
    VectorXd none(0);
    for (const VectorXd& x : starting_points(1 + *std::max_element(beta_of.begin(), beta_of.end())))
      candidates.push_back({x, density(x, none), 1, false});
    evaluations_ += options_.starts;
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Maximum& a, const Maximum& b) { return a.value > b.value; });
    Point best{beta_of, {VectorXd(), -std::numeric_limits<double>::infinity(), 0, false}};
    for (int s = 0; s < options_.searches; ++s) {
      const Maximum found = climb(beta_of, candidates[static_cast<std::size_t>(s)].x);
      if (found.value > best.at.value) best.at = found;
    }
    return best;
  }

  // Beta number 0 is the shared one; each step appends one.
  void select(Point& best) {
    std::vector<int> sharing(static_cast<std::size_t>(inputs_.cols()));
    std::iota(sharing.begin(), sharing.end(), 0);
    while (sharing.size() > 1) {
      Point winner = best;
      int chosen = -1;
      for (int p : sharing) {
        const Point candidate = climb_with_own_beta(best, p);
        if (candidate.at.value > winner.at.value) {
          winner = candidate;
          chosen = p;
        }
      }
      const double gain = winner.at.value - best.at.value;
      if (chosen < 0 || gain < selection_threshold(options_.significance, static_cast<int>(sharing.size())))
        return;
      selection_.push_back({chosen, gain});
      sharing.erase(std::find(sharing.begin(), sharing.end(), chosen));
      best = winner;
    }
  }

  // From where the last step ended, and from there off the plateaus of a nugget near 0 and a beta near 1,
  // from which a gradient leads nowhere.
  Point climb_with_own_beta(const Point& point, int parameter) {
    const Index n = point.at.x.size();
    Point out = point;
    out.beta_of[static_cast<std::size_t>(parameter)] = static_cast<int>(n) - 3;
    VectorXd warm(n + 1);
    warm << point.at.x, point.at.x[3];
    VectorXd raised = warm;
    raised[1] = std::max(warm[1], kLogNugget);
    raised[n] = std::min(warm[n], kLogitBeta);
    out.at = climb(out.beta_of, warm);
    if (raised == warm) return out;
    const Maximum second = climb(out.beta_of, raised);
    if (second.value > out.at.value) out.at = second;
    return out;
  }

  Objective objective(const std::vector<int>& beta_of) {
    return [this, beta_of](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
      return GaussianProcess::log_density(inputs_, values_, priors_, beta_of, x, gradient, memory_);
    };
  }

  Maximum climb(const std::vector<int>& beta_of, const VectorXd& start) {
    VectorXd lower = VectorXd::Constant(start.size(), -9.0), upper = VectorXd::Constant(start.size(), 14.0);
    lower.head(3) = kLower;
    upper.head(3) = kUpper;
    if (!(priors_.lambda.shape > 0)) lower[2] = upper[2];
    const Maximum found = maximise(objective(beta_of), start, lower, upper, 1e-7, options_.max_evaluations);
    evaluations_ += found.evaluations;
    return found;
  }

  // Bounds of log amplitude, log nugget and log lambda.
  const Eigen::Vector3d kLower{-6.0, -25.0, -5.0}, kUpper{14.0, 2.0, 40.0};
  const MatrixXd& inputs_;
  const VectorXd& values_;
  const HyperPriors& priors_;
  const SearchOptions& options_;
  GaussianProcess::Memory memory_;
  int evaluations_ = 0;
  std::vector<SelectionStep> selection_;
};

}  // namespace

void SearchOptions::check() const {
  if (starts < 1 || searches < 1 || searches > starts)
    throw std::invalid_argument("emulator: need 1 <= searches <= starts");
  if (max_evaluations < 1) throw std::invalid_argument("emulator: max_evaluations must be positive");
  if (!(significance > 0 && significance < 1))
    throw std::invalid_argument("emulator: significance must lie in (0, 1)");
}

double selection_threshold(double significance, int k) {
  const boost::math::chi_squared one_degree(1.0);
  return 0.5 * boost::math::quantile(boost::math::complement(one_degree, significance / k));
}

Mode find_mode(const MatrixXd& inputs, const VectorXd& values, const HyperPriors& priors,
               const SearchOptions& options) {
  priors.check();
  options.check();
  return Search(inputs, values, priors, options).run();
}

}  // namespace amiss
