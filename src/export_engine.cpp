// Conversions between R and the engine: convert, call, convert. Nothing is computed here. Numbers are copied,
// never mapped: sums depend in their last bit on how memory is aligned, and only memory of Eigen's is always
// aligned alike.
#include <deque>

#include "export_convert.h"

#include "engine/attribution/Attribution.hpp"
#include "engine/basis/Basis.hpp"
#include "engine/calibration/Calibration.hpp"
#include "engine/calibration/ResponseEvidence.hpp"
#include "engine/calibration/TangentPosterior.hpp"
#include "engine/discrepancy/FilterBank.hpp"
#include "engine/discrepancy/HistoryModel.hpp"
#include "engine/emulator/Emulator.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/TruncatedNormal.hpp"
#include "engine/random/purposes.hpp"

using namespace amiss;  // NOLINT
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

TimeAxis make_axis(const VectorXd& time, const std::vector<bool>& new_segment) { return {time, new_segment}; }

HistoryData make_history_data(const Rcpp::List& data) {
  HistoryData history;
  history.y = Rcpp::as<VectorXd>(data["y"]);
  history.basis = Rcpp::as<MatrixXd>(data["basis"]);
  history.moves = Rcpp::as<MatrixXd>(data["moves"]);
  history.responses = Rcpp::as<MatrixXd>(data["responses"]);
  history.condition = Rcpp::as<std::vector<int>>(data["condition"]);
  history.axis =
      make_axis(Rcpp::as<VectorXd>(data["time"]), Rcpp::as<std::vector<bool>>(data["new_segment"]));
  return history;
}

HistoryPriors make_history_priors(const Rcpp::List& priors) {
  HistoryPriors prior;
  prior.noise_sd = priors["noise_sd"];
  prior.noise_shape = priors["noise_shape"];
  prior.discarded_variance = priors["discarded_variance"];
  prior.inclusion = priors["inclusion"];
  prior.amplitude = priors["amplitude"];
  prior.error.correlation_times = Rcpp::as<VectorXd>(priors["correlation_times"]);
  prior.error.ratios = Rcpp::as<VectorXd>(priors["ratios"]);
  prior.reach = Rcpp::as<std::vector<double>>(priors["reach"]);
  return prior;
}

// Points of the history posterior: one for each element of list(setting, variance, t).
std::vector<HistoryParameters> make_points(const Rcpp::List& draws) {
  const std::vector<int> setting = Rcpp::as<std::vector<int>>(draws["setting"]);
  const VectorXd variance = Rcpp::as<VectorXd>(draws["variance"]);
  const MatrixXd t = Rcpp::as<MatrixXd>(draws["t"]);
  if (static_cast<Eigen::Index>(setting.size()) != variance.size() || t.rows() != variance.size())
    throw std::invalid_argument("points: setting, variance and t differ in number");
  std::vector<HistoryParameters> points;
  for (Eigen::Index i = 0; i < variance.size(); ++i)
    points.push_back({setting[static_cast<std::size_t>(i)], variance[i], t.row(i).transpose()});
  return points;
}

void add_points(Rcpp::List& out, const std::vector<HistoryParameters>& points) {
  const Eigen::Index n = static_cast<Eigen::Index>(points.size());
  const Eigen::Index conditions = points.front().t.size();
  VectorXd variance(n);
  Rcpp::IntegerVector setting(n);
  MatrixXd t(n, conditions);
  for (Eigen::Index i = 0; i < n; ++i) {
    const HistoryParameters& point = points[static_cast<std::size_t>(i)];
    variance[i] = point.variance;
    setting[i] = point.setting;
    t.row(i) = point.t.transpose();
  }
  out["setting"] = setting;
  out["variance"] = variance;
  out["t"] = t;
}

Rcpp::List list_sets(const std::vector<DroppedSet>& sets, std::size_t which) {
  const std::size_t n = sets.size();
  Rcpp::List conditions(n);
  Rcpp::NumericVector lost(n), standard_error(n);
  Rcpp::LogicalVector trusted(n);
  for (std::size_t k = 0; k < n; ++k) {
    conditions[k] = Rcpp::wrap(sets[k].conditions[which]);
    lost[k] = sets[k].lost;
    standard_error[k] = sets[k].standard_error;
    trusted[k] = sets[k].trusted;
  }
  using Rcpp::_;
  return Rcpp::List::create(_["conditions"] = conditions, _["lost"] = lost,
                            _["standard_error"] = standard_error, _["trusted"] = trusted);
}

BetaShapes beta_shapes(const VectorXd& shapes) { return {shapes[0], shapes[1]}; }

Basis read_basis(const Rcpp::List& list) {
  Basis basis;
  basis.vectors = Rcpp::as<MatrixXd>(list["vectors"]);
  basis.coefficients = Rcpp::as<MatrixXd>(list["coefficients"]);
  basis.singular_values = Rcpp::as<VectorXd>(list["singular_values"]);
  basis.discarded_ss = list["discarded_ss"];
  return basis;
}

EmulatorOptions emulator_options(const Rcpp::List& control) {
  EmulatorOptions options;
  options.search.starts = control["starts"];
  options.search.searches = control["searches"];
  options.search.max_evaluations = control["max_evaluations"];
  options.search.forward = Rcpp::as<std::string>(control["selection"]) == "forward";
  options.search.significance = control["significance"];
  options.priors.s2 = beta_shapes(Rcpp::as<VectorXd>(control["s2"]));
  options.priors.eta2 = beta_shapes(Rcpp::as<VectorXd>(control["eta2"]));
  options.priors.beta = beta_shapes(Rcpp::as<VectorXd>(control["beta"]));
  const VectorXd lambda = Rcpp::as<VectorXd>(control["lambda"]);
  options.priors.lambda = {lambda[0], lambda[1]};
  return options;
}

// Records with the models and emulators that they point to: one for each list(data, priors, emulator,
// parameters), these numbered from 1.
struct Records {
  std::deque<HistoryModel> models;
  std::deque<Emulator> emulators;
  std::vector<Record> records;

  Records(const Rcpp::List& from, const Context& context) {
    for (const Rcpp::List one : from) {
      models.emplace_back(make_history_data(one["data"]), make_history_priors(one["priors"]), context);
      emulators.emplace_back(convert::emulator_state(one["emulator"]));
      records.push_back(whole_record(models.back(), emulators.back()));
      records.back().parameters = Rcpp::as<std::vector<int>>(one["parameters"]);
      for (int& parameter : records.back().parameters) --parameter;
    }
  }
};

Rcpp::List list_record(const RecordPosterior& record, const HistoryModel& model) {
  using Rcpp::_;
  Rcpp::List out = Rcpp::List::create(
      _["coefficients"] = record.coefficients, _["withheld"] = record.withheld,
      _["withheld_covariance"] = record.withheld_covariance,
      _["withheld_of_condition"] = record.withheld_of_condition, _["reach"] = record.reach,
      _["tangent"] = convert::simulator_list(record.tangent),
      _["centre"] = VectorXd(model.centre().transpose()), _["scale"] = VectorXd(model.scale().transpose()));
  add_points(out, record.history);
  return out;
}

// Refuses draws that name a setting or a condition that their model lacks, and numbers of draws beyond the
// last.
void check_draws(const Calibration& calibration, const std::deque<HistoryModel>& models) {
  const Eigen::Index draws = calibration.posterior.log_likelihood.size();
  for (const Eigen::Index kept : calibration.kept) {
    if (kept < 0 || kept >= draws)
      throw std::invalid_argument("calibration: a kept draw is none of its draws");
  }
  if (calibration.records.size() != models.size())
    throw std::invalid_argument("calibration: it has other records than its data");
  for (std::size_t r = 0; r < models.size(); ++r) {
    const std::vector<HistoryParameters>& history = calibration.records[r].history;
    if (static_cast<Eigen::Index>(history.size()) != draws)
      throw std::invalid_argument("calibration: draws are missing");
    for (const HistoryParameters& draw : history) {
      if (draw.setting < 0 || draw.setting >= models[r].settings() || draw.t.size() != models[r].conditions())
        throw std::invalid_argument("calibration: a draw is of another model");
    }
  }
}

// What the attribution needs of a calibration.
Calibration make_calibration(const Rcpp::List& fit, const Records& of) {
  Calibration calibration;
  calibration.posterior = convert::ais_summary(fit["posterior"]);
  calibration.kept = Rcpp::as<std::vector<Eigen::Index>>(fit["kept"]);
  for (const Rcpp::List record : Rcpp::List(fit["records"])) {
    calibration.records.emplace_back();
    calibration.records.back().history = make_points(record);
    calibration.records.back().tangent = convert::simulator(record["tangent"]);
  }
  check_draws(calibration, of.models);
  return calibration;
}

AttributionOptions attribution_options(const Rcpp::List& control) {
  AttributionOptions options;
  options.ais = convert::ais_options(control["ais"]);
  options.least = Rcpp::as<double>(control["least"]);
  options.decisive = Rcpp::as<double>(control["decisive"]);
  options.level = Rcpp::as<double>(control["level"]);
  options.surrogates.surrogates = control["surrogates"];
  options.surrogates.smallest_shift = control["smallest_shift"];
  return options;
}

// One row for each step of the forward selection of each coefficient; numbers from 1.
Rcpp::DataFrame selection_table(const Emulator& emulator) {
  std::vector<int> vector, step, parameter;
  std::vector<double> gain;
  const auto selections = emulator.selections();
  for (std::size_t q = 0; q < selections.size(); ++q) {
    for (std::size_t k = 0; k < selections[q].size(); ++k) {
      vector.push_back(static_cast<int>(q) + 1);
      step.push_back(static_cast<int>(k) + 1);
      parameter.push_back(selections[q][k].parameter + 1);
      gain.push_back(selections[q][k].gain);
    }
  }
  using Rcpp::_;
  return Rcpp::DataFrame::create(_["vector"] = vector, _["step"] = step, _["parameter"] = parameter,
                                 _["gain"] = gain);
}

}  // namespace

// [[Rcpp::export]]
Rcpp::List make_basis_(const Eigen::MatrixXd& outputs, const Rcpp::List& control) {
  BasisOptions options;
  options.explained = control["explained"];
  options.noise_sd = control["noise_sd"];
  options.noise_fraction = control["noise_fraction"];
  options.max_vectors = control["max_vectors"];
  const Basis basis = make_basis(outputs, options);
  using Rcpp::_;
  return Rcpp::List::create(_["vectors"] = basis.vectors, _["coefficients"] = basis.coefficients,
                            _["singular_values"] = basis.singular_values, _["explained"] = basis.explained,
                            _["discarded_rms"] = basis.discarded_rms, _["discarded_ss"] = basis.discarded_ss);
}

// Of runs at points (a row each) in the coordinates N(0, I), in their region; with a linear trend (or NULL).
// [[Rcpp::export]]
Rcpp::List train_emulator_(const Eigen::MatrixXd& normal, const Rcpp::RObject& region,
                           const Rcpp::List& basis_list, const Rcpp::RObject& trend,
                           const Rcpp::List& control, const Rcpp::List& context) {
  const MatrixXd inputs = convert::region(region).inputs(normal.transpose());
  const Emulator emulator = Emulator::train(inputs, read_basis(basis_list), emulator_options(control),
                                            convert::context(context), convert::matrix(trend));
  MatrixXd mean, variance;
  emulator.leave_one_out(mean, variance);
  const EmulatorState state = emulator.state();
  using Rcpp::_;
  return Rcpp::List::create(
      _["inputs"] = state.inputs, _["coefficients"] = state.coefficients,
      _["hyperparameters"] = state.parameters, _["loo_mean"] = mean, _["loo_variance"] = variance,
      _["widened"] = emulator.widened(), _["spread"] = over_region(emulator).root,
      _["evaluations"] = emulator.evaluations(), _["selection"] = selection_table(emulator));
}

// [[Rcpp::export]]
Rcpp::List predict_emulator_(const Rcpp::List& emulator, const Eigen::MatrixXd& normal) {
  MatrixXd mean, variance;
  Emulator(convert::emulator_state(emulator)).predict_at(normal.transpose(), mean, variance);
  return Rcpp::List::create(Rcpp::_["mean"] = mean, Rcpp::_["variance"] = variance);
}

// [[Rcpp::export]]
Eigen::MatrixXd filter_bank_(const Eigen::MatrixXd& x, const Eigen::VectorXd& time_constants,
                             const Eigen::VectorXd& time, const std::vector<bool>& new_segment) {
  return FilterBank(x, std::vector<int>(static_cast<std::size_t>(x.cols()), 0), time_constants,
                    make_axis(time, new_segment))
      .responses;
}

// The joint posterior of parameters, errors and discrepancies of one or several records.
// [[Rcpp::export]]
Rcpp::List calibrate_(const Rcpp::List& records, const Rcpp::List& control, const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const Records from(records, context);
  const Calibration result = calibrate(
      from.records, {convert::ais_options(control["ais"]), Rcpp::as<int>(control["error_draws"])}, context);
  Rcpp::List posterior = convert::ais_list(result.posterior), of_records(records.size());
  posterior["unit"] = result.unit;
  for (std::size_t r = 0; r < from.records.size(); ++r)
    of_records[r] = list_record(result.records[r], from.models[r]);
  using Rcpp::_;
  return Rcpp::List::create(_["posterior"] = posterior, _["kept"] = Rcpp::wrap(result.kept),
                            _["records"] = of_records);
}

// Which conditions drive the discrepancy of record `which` (from 1), given a posterior of calibrate_().
// [[Rcpp::export]]
Rcpp::List attribute_(const Rcpp::List& records, int which, const Rcpp::List& fit, const Rcpp::List& control,
                      const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const Records from(records, context);
  const auto own = static_cast<std::size_t>(which - 1);
  const Attribution result =
      attribute(from.records, own, make_calibration(fit, from), attribution_options(control), context);
  using Rcpp::_;
  return Rcpp::List::create(_["sets"] = list_sets(result.sets, own), _["statistic"] = result.test.statistic,
                            _["p_value"] = result.test.p_value, _["adjusted"] = result.test.adjusted,
                            _["null_statistics"] = result.test.null_statistics, _["shares"] = result.shares,
                            _["significant"] = result.significant);
}

// The evidence that a posterior of calibrate_() loses without conditions of each record (numbered from 0).
// [[Rcpp::export]]
Rcpp::List drop_conditions_(const Rcpp::List& records, const Rcpp::List& fit, const Rcpp::List& conditions,
                            const Rcpp::List& ais, const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const Records from(records, context);
  const DroppedSet dropped = drop(from.records, make_calibration(fit, from),
                                  Rcpp::as<ConditionSet>(conditions), convert::ais_options(ais), context);
  using Rcpp::_;
  return Rcpp::List::create(_["lost"] = dropped.lost, _["standard_error"] = dropped.standard_error,
                            _["trusted"] = dropped.trusted);
}

// The posterior under the line that touches the simulator at x0.
// [[Rcpp::export]]
Rcpp::List tangent_posterior_(const Rcpp::List& data, const Rcpp::List& priors, const Eigen::VectorXd& x0,
                              const Eigen::VectorXd& run, const Eigen::MatrixXd& slopes, int draws,
                              const Rcpp::List& ais, const Rcpp::List& context) {
  const TangentPosterior result =
      tangent_posterior(make_history_data(data), make_history_priors(priors), x0, run, slopes, draws,
                        convert::ais_options(ais), convert::context(context));
  Rcpp::List out =
      Rcpp::List::create(Rcpp::_["mean"] = result.mean, Rcpp::_["covariance"] = result.covariance);
  add_points(out, result.history);
  return out;
}

// Where a Gauss-Newton step leads for points of error and discrepancy that are known.
// [[Rcpp::export]]
Rcpp::List tangent_given_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& points,
                          const Eigen::VectorXd& x0, const Eigen::VectorXd& run,
                          const Eigen::MatrixXd& slopes, const Rcpp::List& context) {
  const TangentOptimum result =
      tangent_given(make_history_data(data), make_history_priors(priors), make_points(points), x0, run,
                    slopes, convert::context(context));
  return Rcpp::List::create(Rcpp::_["mean"] = result.mean, Rcpp::_["covariance"] = result.covariance);
}

// Draws of a normal distribution between `lower` and `upper`.
// [[Rcpp::export]]
Eigen::MatrixXd draws_within_(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance,
                              const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                              const Eigen::VectorXd& start, int n, double seed) {
  Stream stream(static_cast<std::uint64_t>(seed), kWithinLimits, 0);
  return draws_within(mean, covariance, lower, upper, start, n, stream);
}

// Evidence of a calibration's tangent and of the responses (N x k) to a change of the simulator.
// [[Rcpp::export]]
Rcpp::List response_evidence_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& tangent,
                              const Eigen::MatrixXd& responses, const Rcpp::List& ais,
                              const Rcpp::List& context) {
  return convert::ais_list(response_evidence(make_history_data(data), make_history_priors(priors),
                                             convert::simulator(tangent), responses,
                                             convert::ais_options(ais), convert::context(context)));
}

// Log-likelihood of runs of the simulator itself (N x n), each at its points of the history posterior, which
// follow one another.
// [[Rcpp::export]]
Eigen::VectorXd run_likelihood_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& points,
                                const Eigen::MatrixXd& runs, const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  return HistoryModel(make_history_data(data), make_history_priors(priors), context,
                      Rcpp::as<std::vector<int>>(points["setting"]))
      .log_likelihood_of_runs(make_points(points), runs, context);
}
