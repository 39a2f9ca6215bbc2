// Conversions between R and the engine: convert, call, convert. Nothing is computed here. Numbers are copied,
// never mapped: sums depend in their last bit on how memory is aligned, and only memory of Eigen's is always
// aligned alike.
#include "export_convert.h"

#include "engine/attribution/ShapleyShares.hpp"
#include "engine/attribution/SurrogateTest.hpp"
#include "engine/basis/Basis.hpp"
#include "engine/calibration/Calibration.hpp"
#include "engine/discrepancy/FilterBank.hpp"
#include "engine/discrepancy/HistoryModel.hpp"
#include "engine/emulator/Emulator.hpp"
#include "engine/parallel/parallel_for.hpp"

using namespace amiss;  // NOLINT
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

TimeAxis make_axis(const VectorXd& time, const std::vector<bool>& new_segment) { return {time, new_segment}; }

HistoryModel make_history_model(const Rcpp::List& data, const Rcpp::List& priors, const Context& context) {
  HistoryData history;
  history.y = Rcpp::as<VectorXd>(data["y"]);
  history.basis = Rcpp::as<MatrixXd>(data["basis"]);
  history.responses = Rcpp::as<MatrixXd>(data["responses"]);
  history.condition = Rcpp::as<std::vector<int>>(data["condition"]);
  history.axis =
      make_axis(Rcpp::as<VectorXd>(data["time"]), Rcpp::as<std::vector<bool>>(data["new_segment"]));
  HistoryPriors prior;
  prior.noise_sd = priors["noise_sd"];
  prior.noise_shape = priors["noise_shape"];
  prior.inclusion = priors["inclusion"];
  prior.amplitude = priors["amplitude"];
  prior.error.correlation_times = Rcpp::as<VectorXd>(priors["correlation_times"]);
  prior.error.ratios = Rcpp::as<VectorXd>(priors["ratios"]);
  return HistoryModel(std::move(history), std::move(prior), context);
}

std::vector<int> all_conditions(const HistoryModel& model) {
  std::vector<int> all(static_cast<std::size_t>(model.conditions()));
  for (std::size_t s = 0; s < all.size(); ++s) all[s] = static_cast<int>(s);
  return all;
}

template <class Parameters>
void add_history_draws(Rcpp::List& out, const AisResult& result, Parameters parameters,
                       const HistoryModel& model) {
  const Eigen::Index draws = result.draws.cols();
  VectorXd variance(draws);
  Rcpp::IntegerVector setting(draws);
  MatrixXd t(draws, model.conditions());
  for (Eigen::Index i = 0; i < draws; ++i) {
    const HistoryParameters point = parameters(VectorXd(result.draws.col(i)));
    variance[i] = point.variance;
    setting[i] = point.setting;
    t.row(i) = point.t.transpose();
  }
  out["setting"] = setting;
  out["variance"] = variance;
  out["t"] = t;
}

BetaShapes beta_shapes(const VectorXd& shapes) { return {shapes[0], shapes[1]}; }

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

// [[Rcpp::export]]
Rcpp::List train_emulator_(const Eigen::MatrixXd& inputs, const Rcpp::List& basis_list,
                           const Rcpp::List& control, const Rcpp::List& context) {
  Basis basis;
  basis.vectors = Rcpp::as<MatrixXd>(basis_list["vectors"]);
  basis.coefficients = Rcpp::as<MatrixXd>(basis_list["coefficients"]);
  basis.singular_values = Rcpp::as<VectorXd>(basis_list["singular_values"]);
  basis.discarded_ss = basis_list["discarded_ss"];
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
  const Emulator emulator = Emulator::train(inputs, basis, options, convert::context(context));
  MatrixXd mean, variance;
  emulator.leave_one_out(mean, variance);
  const EmulatorState state = emulator.state();
  using Rcpp::_;
  return Rcpp::List::create(_["inputs"] = state.inputs, _["coefficients"] = state.coefficients,
                            _["hyperparameters"] = state.parameters, _["loo_mean"] = mean,
                            _["loo_variance"] = variance, _["widened"] = emulator.widened(),
                            _["evaluations"] = emulator.evaluations(),
                            _["selection"] = selection_table(emulator));
}

// [[Rcpp::export]]
Rcpp::List predict_emulator_(const Rcpp::List& emulator, const Eigen::MatrixXd& points) {
  MatrixXd mean, variance;
  Emulator(convert::emulator_state(emulator)).predict(points, mean, variance);
  return Rcpp::List::create(Rcpp::_["mean"] = mean, Rcpp::_["variance"] = variance);
}

// [[Rcpp::export]]
Eigen::MatrixXd filter_bank_(const Eigen::MatrixXd& x, const Eigen::VectorXd& time_constants,
                             const Eigen::VectorXd& time, const std::vector<bool>& new_segment) {
  return FilterBank(x, std::vector<int>(static_cast<std::size_t>(x.cols()), 0), time_constants,
                    make_axis(time, new_segment))
      .responses;
}

// The history posterior on the part of y outside the simulation space, then the joint posterior on all of y.
// [[Rcpp::export]]
Rcpp::List calibrate_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& emulator_list,
                      const Rcpp::List& control, const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const AisOptions options = convert::ais_options(control);
  const HistoryModel model = make_history_model(data, priors, context);
  const HistoryTarget history(model, all_conditions(model));
  const AisResult outside = sample_ais(history, options, context);

  Context second = context;
  second.seed = context.seed + 1;
  Stream stream(context.seed, 0, 0);
  const Emulator emulator(convert::emulator_state(emulator_list));
  const CalibrationTarget target(
      history, StudentTMixture::fit(outside.draws, outside.weights, options.max_components, 8.0, stream),
      emulator);
  const CalibrationSample sample = sample_calibration(target, outside, options, second);
  const AisResult& joint = sample.posterior;

  Rcpp::List outside_list = convert::ais_list(outside), joint_list = convert::ais_list(joint);
  add_history_draws(
      outside_list, outside, [&](const VectorXd& x) { return history.parameters(x); }, model);
  add_history_draws(
      joint_list, joint, [&](const VectorXd& x) { return target.history(x); }, model);
  joint_list["unit"] = target.unit(joint.draws);
  using Rcpp::_;
  return Rcpp::List::create(_["history"] = outside_list, _["posterior"] = joint_list,
                            _["misfits"] = sample.misfits, _["centre"] = VectorXd(model.centre().transpose()),
                            _["scale"] = VectorXd(model.scale().transpose()),
                            _["null_setting"] = null_setting(model));
}

// Posterior mean coefficients (p x draws) of the scaled filter columns, for given draws of the history
// parameters.
// [[Rcpp::export]]
Eigen::MatrixXd history_coefficients_(const Rcpp::List& data, const Rcpp::List& priors,
                                      const Rcpp::List& draws) {
  const HistoryModel model = make_history_model(data, priors, Context());
  const std::vector<int> setting = Rcpp::as<std::vector<int>>(draws["setting"]);
  const VectorXd variance = Rcpp::as<VectorXd>(draws["variance"]);
  const MatrixXd t = Rcpp::as<MatrixXd>(draws["t"]);
  MatrixXd coefficients(model.data().responses.cols(), variance.size());
  for (Eigen::Index j = 0; j < variance.size(); ++j) {
    coefficients.col(j) =
        model.coefficients(model.whitened(setting[j]), std::log(variance[j]), t.row(j).transpose());
  }
  return coefficients;
}

// Shapley shares of the discrepancy (draws x S), for given draws of the history parameters.
// [[Rcpp::export]]
Eigen::MatrixXd shapley_shares_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& draws,
                                const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const HistoryModel model = make_history_model(data, priors, context);
  const std::vector<int> setting = Rcpp::as<std::vector<int>>(draws["setting"]);
  const VectorXd variance = Rcpp::as<VectorXd>(draws["variance"]);
  const MatrixXd t = Rcpp::as<MatrixXd>(draws["t"]);
  std::vector<HistoryParameters> points;
  for (Eigen::Index j = 0; j < variance.size(); ++j)
    points.push_back({setting[static_cast<std::size_t>(j)], variance[j], t.row(j).transpose()});
  return shapley_shares(model, points, ShapleyOptions(), context);
}

// Evidence without each of the given conditions (0-based), and the surrogate test of all.
// [[Rcpp::export]]
Rcpp::List attribute_(const Rcpp::List& data, const Rcpp::List& priors, const std::vector<int>& drop,
                      const Rcpp::IntegerVector& error_settings, const Rcpp::List& control,
                      const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const HistoryModel model = make_history_model(data, priors, context);
  const AisOptions options = convert::ais_options(control["ais"]);
  const int drops = static_cast<int>(drop.size());
  std::vector<AisResult> dropped(drop.size());
  parallel_for(drops, context, [&](int i) {
    std::vector<int> active = all_conditions(model);
    active.erase(active.begin() + drop[i]);
    Context own = context.alone();  // conditions share the threads; each has its own seed
    own.seed = context.seed + 1 + static_cast<std::uint64_t>(drop[i]);
    dropped[i] = sample_ais(HistoryTarget(model, active), options, own);
  });
  SurrogateOptions surrogates;
  surrogates.surrogates = control["surrogates"];
  surrogates.smallest_shift = control["smallest_shift"];
  surrogates.error_settings = Rcpp::as<std::vector<int>>(error_settings);
  const SurrogateTest test = surrogate_test(model, surrogates, context);

  VectorXd log_evidence(drops), standard_error(drops);
  std::vector<bool> trusted(drop.size());
  for (int i = 0; i < drops; ++i) {
    log_evidence[i] = dropped[i].log_evidence;
    standard_error[i] = dropped[i].standard_error;
    trusted[i] = dropped[i].trusted;
  }
  using Rcpp::_;
  return Rcpp::List::create(_["log_evidence_dropped"] = log_evidence, _["standard_error"] = standard_error,
                            _["trusted"] = trusted, _["statistic"] = test.statistic,
                            _["p_value"] = test.p_value, _["adjusted"] = test.adjusted,
                            _["null_statistics"] = test.null_statistics);
}
