// Conversions between R and the method as in the paper: convert, call, convert. Nothing is computed here.
#include <RcppEigen.h>

#include "engine/attribution/VarianceIndex.hpp"
#include "engine/calibration/PaperCalibration.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "engine/discrepancy/KernelSampling.hpp"
#include "export_convert.h"

using namespace amiss;  // NOLINT
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

KernelData make_kernel_data(const Rcpp::List& data) {
  KernelData kernel;
  kernel.y = Rcpp::as<VectorXd>(data["y"]);
  kernel.basis = Rcpp::as<MatrixXd>(data["basis"]);
  kernel.conditions = Rcpp::as<MatrixXd>(data["conditions"]);
  kernel.condition = Rcpp::as<std::vector<int>>(data["condition"]);
  kernel.fictitious = fictitious_condition(
      kernel.y.size(), static_cast<std::uint64_t>(Rcpp::as<double>(data["fictitious_seed"])));
  return kernel;
}

BetaPrior make_beta(const Rcpp::NumericVector& shapes) { return {shapes[0], shapes[1]}; }

KernelPriors make_kernel_priors(const Rcpp::List& priors) {
  KernelPriors out;
  out.alpha = make_beta(priors["alpha"]);
  out.t2 = make_beta(priors["t2"]);
  out.noise.sd = priors["noise_sd"];
  out.noise.shape = priors["noise_shape"];
  return out;
}

std::vector<KernelParameters> make_draws(const KernelTarget& target, const MatrixXd& x) {
  std::vector<KernelParameters> draws;
  for (Eigen::Index i = 0; i < x.cols(); ++i) draws.push_back(target.parameters(x.col(i)));
  return draws;
}

Rcpp::List list_draws(const std::vector<KernelParameters>& draws, int conditions) {
  const Eigen::Index n = static_cast<Eigen::Index>(draws.size());
  MatrixXd alpha(n, conditions + 1);
  VectorXd t2(n), lambda(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const KernelParameters& p = draws[static_cast<std::size_t>(i)];
    alpha.row(i) = p.alpha().transpose();
    t2[i] = p.t2();
    lambda[i] = p.lambda;
  }
  return Rcpp::List::create(Rcpp::_["alpha"] = alpha, Rcpp::_["t2"] = t2, Rcpp::_["lambda"] = lambda);
}

Rcpp::List list_index(const VarianceIndex& index) {
  const std::size_t s = index.hdi.size();
  Rcpp::NumericVector lower(s), upper(s);
  for (std::size_t k = 0; k < s; ++k) {
    lower[k] = index.hdi[k].lower;
    upper[k] = index.hdi[k].upper;
  }
  using Rcpp::_;
  return Rcpp::List::create(_["share"] = index.share, _["mean"] = index.mean, _["median"] = index.median,
                            _["lower"] = lower, _["upper"] = upper,
                            _["significant"] = Rcpp::wrap(index.significant),
                            _["rank"] = Rcpp::wrap(index.rank));
}

}  // namespace

// Posterior (6), posterior (5), and the variance index over the draws of (6).
// [[Rcpp::export]]
Rcpp::List calibrate_paper_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& emulator_list,
                            const Rcpp::List& control, const Rcpp::List& context_list) {
  const Context context = convert::context(context_list);
  const AisOptions options = convert::ais_options(control["ais"]);
  const KernelData kernel = make_kernel_data(data);
  const KernelModel model(kernel, make_kernel_priors(priors));
  const KernelTarget outside_target(model);
  const double tolerance = Rcpp::as<double>(control["tolerance"]);
  KernelSample sample;
  if (tolerance > 0) {
    KernelSamplingOptions sampling;
    sampling.tolerance = tolerance;
    sample = sample_kernel(model, options, sampling, context);
  } else {
    sample.posterior = sample_ais(outside_target, options, context);
    sample.direct = sample.posterior.evaluations;
  }
  const AisResult& outside = sample.posterior;

  Context second = context;
  second.seed = context.seed + 1;
  const PaperCalibration coefficients(kernel.y, kernel.basis);
  const Emulator emulator(convert::emulator_state(emulator_list));
  const PaperCalibrationTarget inside_target(coefficients, emulator, model.priors().noise,
                                             Rcpp::as<bool>(control["shared_lambda"]));
  const AisResult inside = sample_ais(inside_target, options, second);

  const std::vector<KernelParameters> draws = make_draws(outside_target, outside.draws);
  const VarianceIndex index =
      variance_index(model, draws, outside.weights, Rcpp::as<double>(control["probability"]), context);
  Rcpp::List outside_list = convert::ais_list(outside), inside_list = convert::ais_list(inside);
  outside_list["hyperparameters"] = list_draws(draws, model.conditions());
  outside_list["approximation"] = Rcpp::List::create(
      Rcpp::_["largest_error"] = sample.largest_error, Rcpp::_["correction"] = sample.correction,
      Rcpp::_["values"] = Rcpp::IntegerVector::create(Rcpp::_["earlier"] = sample.coarse,
                                                      Rcpp::_["skeleton"] = sample.by_skeleton,
                                                      Rcpp::_["direct"] = sample.direct));
  inside_list["unit"] = inside_target.unit(inside.draws);
  inside_list["lambda"] = inside_target.lambda(inside.draws);
  using Rcpp::_;
  return Rcpp::List::create(_["inside"] = inside_list, _["outside"] = outside_list,
                            _["index"] = list_index(index), _["log_jacobian"] = coefficients.log_jacobian());
}

// The fictitious condition x_0 of (6).
// [[Rcpp::export]]
Eigen::VectorXd fictitious_condition_(int n, double seed) {
  return fictitious_condition(n, static_cast<std::uint64_t>(seed));
}

// Posterior mean of the discrepancy (N x draws, equation 8) for draws of the hyper-parameters of (6).
// [[Rcpp::export]]
Eigen::MatrixXd paper_discrepancy_(const Rcpp::List& data, const Rcpp::List& priors,
                                   const Rcpp::List& draws) {
  const KernelModel model(make_kernel_data(data), make_kernel_priors(priors));
  const MatrixXd alpha = Rcpp::as<MatrixXd>(draws["alpha"]);
  const VectorXd t2 = Rcpp::as<VectorXd>(draws["t2"]), lambda = Rcpp::as<VectorXd>(draws["lambda"]);
  MatrixXd out(model.size(), alpha.rows());
  for (Eigen::Index i = 0; i < alpha.rows(); ++i) {
    KernelParameters p;
    p.decay = -4.0 * alpha.row(i).transpose().array().log();
    p.amplitude = (1.0 - t2[i]) / t2[i];
    p.lambda = lambda[i];
    out.col(i) = model.discrepancy(p);
  }
  return out;
}
