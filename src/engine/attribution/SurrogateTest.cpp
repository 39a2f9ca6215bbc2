#include "engine/attribution/SurrogateTest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/optimise/maximise.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::uint64_t kShifts = 11;
constexpr double kNegligible = 0.02;  // nats: a condition that matters less need not be fitted again without

struct Fit {
  double value = -std::numeric_limits<double>::infinity();
  VectorXd x;  // log sigma^2, log t_s
};

VectorXd variances(const VectorXd& x, int dropped) {
  VectorXd t = x.tail(x.size() - 1).array().exp();
  if (dropped >= 0) t[dropped] = 0.0;
  return t;
}

// Largest likelihood over sigma^2 and all t_s but that of the dropped condition (-1: none).
Fit best_fit(const HistoryModel& model, const WhitenedData& data, int dropped, const VectorXd& start,
             double log_scale, const SurrogateOptions& options) {
  const Objective objective = [&](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    VectorXd slope;
    const double value = model.log_likelihood(data, x[0], variances(x, dropped), &slope);
    gradient = slope;
    return value;
  };
  VectorXd lower = VectorXd::Constant(start.size(), log_scale - 16.0);
  VectorXd upper = VectorXd::Constant(start.size(), log_scale + 12.0);
  upper[0] = log_scale + 3.0;
  const Maximum found = maximise(objective, start, lower, upper, 1e-9, options.max_evaluations);
  return {found.value, found.x};
}

// Loss of log-likelihood by dropping each condition, for data seen under each of the error settings.
VectorXd drop_losses(const HistoryModel& model, const std::vector<WhitenedData>& settings,
                     const SurrogateOptions& options) {
  const int conditions = model.conditions();
  std::vector<Fit> full;
  for (const auto& data : settings) {
    const double log_scale = std::log(data.square / static_cast<double>(data.residual_dimension));
    VectorXd start = VectorXd::Constant(1 + conditions, log_scale - 3.0);
    start[0] = log_scale - 0.5;
    full.push_back(best_fit(model, data, -1, start, log_scale, options));
  }
  double best = full[0].value;
  for (const Fit& fit : full) best = std::max(best, fit.value);
  VectorXd losses(conditions);
  for (int s = 0; s < conditions; ++s) {
    double without = -std::numeric_limits<double>::infinity();
    for (std::size_t g = 0; g < settings.size(); ++g) {
      const VectorXd& x = full[g].x;
      double value = model.log_likelihood(settings[g], x[0], variances(x, s));
      if (full[g].value - value > kNegligible) {
        const double log_scale =
            std::log(settings[g].square / static_cast<double>(settings[g].residual_dimension));
        value = std::max(value, best_fit(model, settings[g], s, x, log_scale, options).value);
      }
      without = std::max(without, value);
    }
    losses[s] = std::max(0.0, best - without);
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
  if (error_settings.empty()) throw std::invalid_argument("surrogates: no error setting given");
}

VectorXd holm(const VectorXd& p_values) {
  const Index n = p_values.size();
  std::vector<Index> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return p_values[a] < p_values[b]; });
  VectorXd adjusted(n);
  double running = 0.0;
  for (Index k = 0; k < n; ++k) {
    running = std::max(running, std::min(1.0, static_cast<double>(n - k) * p_values[order[k]]));
    adjusted[order[k]] = running;
  }
  return adjusted;
}

int null_setting(const HistoryModel& model) {
  int best = 0;
  double highest = -std::numeric_limits<double>::infinity();
  const VectorXd none = VectorXd::Zero(model.conditions());
  for (int g = 0; g < model.settings(); ++g) {
    const WhitenedData& data = model.whitened(g);
    const double value = model.log_likelihood(
        data, std::log(data.square / static_cast<double>(data.residual_dimension)), none);
    if (value > highest) {
      highest = value;
      best = g;
    }
  }
  return best;
}

SurrogateTest surrogate_test(const HistoryModel& model, const SurrogateOptions& options,
                             const Context& context) {
  options.check();
  const ErrorOptions& error = model.priors().error;
  std::vector<WhitenedData> settings;
  for (int g : options.error_settings) settings.push_back(model.whitened(g));
  SurrogateTest test;
  test.statistic = drop_losses(model, settings, options);

  const std::vector<Index> lags = draw_lags(model.data().y.size(), options, context);
  const int n = static_cast<int>(lags.size());
  test.null_statistics.resize(n, model.conditions());
  parallel_for(n, context, [&](int b) {
    HistoryData data = model.data();
    data.responses = shifted(data.responses, lags[b]);
    std::vector<WhitenedData> own;
    for (int g : options.error_settings)
      own.push_back(whiten(data, error.correlation_times, error.setting(g)));
    test.null_statistics.row(b) = drop_losses(model, own, options).transpose();
  });
  test.p_value.resize(model.conditions());
  for (int s = 0; s < model.conditions(); ++s) {
    const double as_large =
        static_cast<double>((test.null_statistics.col(s).array() >= test.statistic[s]).count());
    test.p_value[s] = (1.0 + as_large) / (1.0 + n);
  }
  test.adjusted = holm(test.p_value);
  return test;
}

}  // namespace amiss
