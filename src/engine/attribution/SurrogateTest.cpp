#include "engine/attribution/SurrogateTest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "engine/optimise/maximise.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/Stream.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTolerance = 1e-5;  // of a fit, relative: a few thousandths of a nat
// log t_s below the log variance of the whole error, white or not, where fits begin: an autocorrelated error
// can do what responses do, so that the likelihood has more than one maximum.
constexpr double kStarts[] = {1.0, 4.0, 8.0};
// Least log variance of an error, below that of the stated noise: a millionth of its standard deviation. A
// simulator that reproduces its record leaves nothing, and nothing responds.
constexpr double kLeastError = -28.0;
constexpr double kNegligible = 0.02;  // nats: a condition that matters less need not be fitted again without

struct Fit {
  double value = -std::numeric_limits<double>::infinity();
  VectorXd x;  // log sigma^2, log t_s, in units of the stated noise variance
};

using Set = std::vector<int>;

double log_unit(const HistoryModel& model) { return 2.0 * std::log(model.priors().noise_sd); }

// As a density of the data in units of the stated noise: where a search ends, and with it the test, does not
// hang on the target's unit.
double log_likelihood(const HistoryModel& model, const WhitenedData& data, const VectorXd& x,
                      const Set& dropped, VectorXd* gradient = nullptr) {
  const double unit = log_unit(model);
  VectorXd t = (x.tail(x.size() - 1).array() + unit).exp();
  for (int s : dropped) t[s] = 0.0;
  return model.log_likelihood(data, x[0] + unit, t, gradient) + 0.5 * static_cast<double>(data.size) * unit;
}

// log sigma^2 at which the quadratic form without any response is about N.
double log_error_scale(const HistoryModel& model, const WhitenedData& data) {
  constexpr int kIterations = 5;
  const VectorXd none = VectorXd::Zero(model.conditions());
  const double least = log_unit(model) + kLeastError;
  double log_variance = log_unit(model);
  for (int k = 0; k < kIterations; ++k) {
    const double ratio = model.quadratic(data, log_variance, none) / static_cast<double>(data.size);
    log_variance = ratio > 0.0 ? std::max(least, log_variance + std::log(ratio)) : least;
  }
  return log_variance;
}

// Largest likelihood over sigma^2 and all t_s but those of the dropped conditions.
Fit best_fit(const HistoryModel& model, const WhitenedData& data, const Set& dropped, const VectorXd& start,
             double log_scale, const SurrogateOptions& options) {
  const Objective objective = [&](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    VectorXd slope;
    const double value = log_likelihood(model, data, x, dropped, &slope);
    gradient = slope;
    return value;
  };
  VectorXd lower = VectorXd::Constant(start.size(), log_scale - 16.0);
  VectorXd upper = VectorXd::Constant(start.size(), log_scale + 12.0);
  upper[0] = log_scale + 3.0;
  const Maximum found = maximise(objective, start, lower, upper, kTolerance, options.max_evaluations);
  return {found.value, found.x};
}

// The others as strong as what is dropped: one that lies near zero stays there, though it could do the same.
VectorXd taken_over(VectorXd x, const Set& dropped) {
  double most = -std::numeric_limits<double>::infinity();
  for (int s : dropped) most = std::max(most, x[1 + s]);
  x.tail(x.size() - 1) = x.tail(x.size() - 1).cwiseMax(most);
  return x;
}

// Loss of log-likelihood by dropping each set, for data seen under each of the settings.
VectorXd drop_losses(const HistoryModel& model, const std::vector<WhitenedData>& settings,
                     const std::vector<Set>& sets, const SurrogateOptions& options) {
  std::vector<Fit> full;
  std::vector<double> log_scale;
  for (std::size_t g = 0; g < settings.size(); ++g) {
    log_scale.push_back(log_error_scale(model, settings[g]) - log_unit(model));
    const int error = model.error_of(options.settings[g]);
    const double whole = log_scale.back() + std::log1p(model.priors().error.setting(error).sum());
    Fit highest{-std::numeric_limits<double>::infinity(), VectorXd::Constant(1 + model.conditions(), whole)};
    for (double below : kStarts) {
      VectorXd start = VectorXd::Constant(1 + model.conditions(), whole - below);
      start[0] = log_scale.back() - 0.5;
      Fit fit = best_fit(model, settings[g], {}, start, log_scale.back(), options);
      if (fit.value > highest.value) highest = std::move(fit);
    }
    full.push_back(std::move(highest));
  }
  double best = full[0].value;
  for (const Fit& fit : full) best = std::max(best, fit.value);
  VectorXd losses(static_cast<Index>(sets.size()));
  for (std::size_t s = 0; s < sets.size(); ++s) {
    double without = -std::numeric_limits<double>::infinity();
    for (std::size_t g = 0; g < settings.size(); ++g) {
      const VectorXd& x = full[g].x;
      double value = log_likelihood(model, settings[g], x, sets[s]);
      if (full[g].value - value > kNegligible) {
        for (const VectorXd& start : {x, taken_over(x, sets[s])})
          value = std::max(value, best_fit(model, settings[g], sets[s], start, log_scale[g], options).value);
      }
      without = std::max(without, value);
    }
    losses[static_cast<Index>(s)] = std::max(0.0, best - without);
  }
  return losses;
}

MatrixXd shifted(const MatrixXd& x, Index lag) {
  MatrixXd out(x.rows(), x.cols());
  out.topRows(lag) = x.bottomRows(lag);
  out.bottomRows(x.rows() - lag) = x.topRows(x.rows() - lag);
  return out;
}

std::vector<Index> draw_lags(Index n, const SurrogateOptions& options, const Context& context) {
  const Index smallest =
      std::max<Index>(1, static_cast<Index>(options.smallest_shift * static_cast<double>(n)));
  std::vector<Index> lags(static_cast<std::size_t>(std::max<Index>(1, n - 2 * smallest + 1)));
  std::iota(lags.begin(), lags.end(), smallest);
  Stream stream(context.seed, kShifts, 0);
  for (std::size_t i = lags.size() - 1; i > 0; --i)
    std::swap(lags[i], lags[stream.index(static_cast<int>(i) + 1)]);
  if (static_cast<int>(lags.size()) > options.surrogates) lags.resize(options.surrogates);
  return lags;
}

}  // namespace

void SurrogateOptions::check() const {
  if (surrogates < 1) throw std::invalid_argument("surrogates: at least one is needed");
  if (!(smallest_shift >= 0 && smallest_shift < 0.5))
    throw std::invalid_argument("surrogates: smallest_shift must lie in [0, 0.5)");
  if (settings.empty()) throw std::invalid_argument("surrogates: no setting of error and reach given");
}

VectorXd adjusted_p_values(const VectorXd& statistic, const MatrixXd& null_statistics, double least) {
  const Index n = null_statistics.rows(), sets = statistic.size();
  VectorXd observed(sets);
  MatrixXd null(n, sets);
  for (Index s = 0; s < sets; ++s) {
    VectorXd sorted = null_statistics.col(s);
    std::sort(sorted.data(), sorted.data() + n);
    const double unit = std::max(least, sorted[static_cast<Index>(0.95 * static_cast<double>(n - 1))]);
    observed[s] = statistic[s] / unit;
    null.col(s) = null_statistics.col(s) / unit;
  }
  std::vector<Index> order(static_cast<std::size_t>(sets));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return observed[a] < observed[b]; });
  // From the smallest up, the largest null statistic so far; then p-values may not fall from the largest
  // down.
  VectorXd adjusted(sets), highest = VectorXd::Constant(n, -std::numeric_limits<double>::infinity());
  for (Index s : order) {
    highest = highest.cwiseMax(null.col(s));
    const double as_high = static_cast<double>((highest.array() >= observed[s]).count());
    adjusted[s] = (1.0 + as_high) / (1.0 + static_cast<double>(n));
  }
  double running = 0.0;
  for (auto s = order.rbegin(); s != order.rend(); ++s)
    adjusted[*s] = running = std::max(running, adjusted[*s]);
  return adjusted;
}

int null_setting(const HistoryModel& model, const GaussianSimulator& simulator) {
  int best = 0;
  double highest = -std::numeric_limits<double>::infinity();
  const VectorXd none = VectorXd::Zero(model.conditions()), shift = simulator.mean - model.reference();
  for (int g = 0; g < model.error_settings(); ++g) {  // without responses they have no reach
    const WhitenedData data = model.whitened(g).in_terms_of(shift, simulator.root);
    const double value = model.log_likelihood(data, log_error_scale(model, data), none);
    if (value > highest) {
      highest = value;
      best = g;
    }
  }
  return best;
}

SurrogateTest surrogate_test(const HistoryModel& model, const GaussianSimulator& simulator,
                             const std::vector<Set>& sets, const SurrogateOptions& options,
                             const Context& context) {
  options.check();
  const VectorXd shift = simulator.mean - model.reference();
  const auto losses = [&](const MatrixXd& responses) {
    std::vector<WhitenedData> settings;
    for (int g : options.settings)
      settings.push_back(model.whiten(g, responses).in_terms_of(shift, simulator.root));
    return drop_losses(model, settings, sets, options);
  };
  SurrogateTest test;
  test.statistic = losses(model.data().responses);
  const std::vector<Index> lags = draw_lags(model.data().y.size(), options, context);
  const int n = static_cast<int>(lags.size());
  test.null_statistics.resize(n, static_cast<Index>(sets.size()));
  parallel_for(n, context, [&](int b) {
    test.null_statistics.row(b) =
        losses(shifted(model.data().responses, lags[static_cast<std::size_t>(b)])).transpose();
  });
  test.p_value.resize(test.statistic.size());
  for (Index s = 0; s < test.statistic.size(); ++s) {
    const double as_large =
        static_cast<double>((test.null_statistics.col(s).array() >= test.statistic[s]).count());
    test.p_value[s] = (1.0 + as_large) / (1.0 + n);
  }
  test.adjusted = adjusted_p_values(test.statistic, test.null_statistics);
  return test;
}

}  // namespace amiss
