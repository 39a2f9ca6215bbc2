// Conversions between R and the method as in the paper: convert, call, convert. Nothing is computed here.
#include <RcppEigen.h>

#include "engine/attribution/VarianceIndex.hpp"
#include "engine/calibration/PaperFit.hpp"
#include "engine/discrepancy/LowRankKernel.hpp"
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
  out.unit = priors["unit"];
  out.noise.sd = priors["noise_sd"];
  out.noise.shape = priors["noise_shape"];
  return out;
}

Rcpp::List list_draws(const std::vector<KernelParameters>& draws, int conditions, double unit) {
  const Eigen::Index n = static_cast<Eigen::Index>(draws.size());
  MatrixXd alpha(n, conditions + 1);
  VectorXd t2(n), lambda(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const KernelParameters& p = draws[static_cast<std::size_t>(i)];
    alpha.row(i) = p.alpha().transpose();
    t2[i] = p.t2(unit);
    lambda[i] = p.lambda;
  }
  return Rcpp::List::create(Rcpp::_["alpha"] = alpha, Rcpp::_["t2"] = t2, Rcpp::_["lambda"] = lambda);
}

std::vector<KernelParameters> make_draws(const Rcpp::List& draws, double unit) {
  const MatrixXd alpha = Rcpp::as<MatrixXd>(draws["alpha"]);
  const VectorXd t2 = Rcpp::as<VectorXd>(draws["t2"]), lambda = Rcpp::as<VectorXd>(draws["lambda"]);
  std::vector<KernelParameters> out(static_cast<std::size_t>(alpha.rows()));
  for (Eigen::Index i = 0; i < alpha.rows(); ++i) {
    KernelParameters& p = out[static_cast<std::size_t>(i)];
    p.decay = -4.0 * alpha.row(i).transpose().array().log();
    p.amplitude = unit * unit * ((1.0 - t2[i]) / t2[i]);
    p.lambda = lambda[i];
  }
  return out;
}

Rcpp::List list_approximation(const KernelSample& sample) {
  using Rcpp::_;
  return Rcpp::List::create(
      _["largest_error"] = sample.largest_error, _["correction"] = sample.correction,
      _["values"] = Rcpp::IntegerVector::create(
          _["earlier"] = sample.coarse, _["skeleton"] = sample.by_skeleton, _["direct"] = sample.direct));
}

PaperOptions paper_options(const Rcpp::List& control) {
  return {convert::ais_options(control["ais"]), Rcpp::as<double>(control["tolerance"]),
          Rcpp::as<bool>(control["shared_lambda"])};
}

Rcpp::List list_inside(const PaperFit& fit) {
  Rcpp::List inside = convert::ais_list(fit.inside);
  inside["unit"] = fit.unit;
  inside["lambda"] = fit.lambda;
  return inside;
}

Rcpp::List list_outside(const PaperFit& fit, const KernelModel& model) {
  Rcpp::List outside = convert::ais_list(fit.outside.posterior);
  outside["hyperparameters"] = list_draws(fit.draws, model.conditions(), model.priors().unit);
  outside["approximation"] = list_approximation(fit.outside);
  return outside;
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
  const KernelData kernel = make_kernel_data(data);
  const KernelModel model(kernel, make_kernel_priors(priors));
  const PaperFit fit =
      calibrate_paper(model, PaperCalibration(kernel.y, kernel.basis),
                      Emulator(convert::emulator_state(emulator_list)), paper_options(control), context);
  const VarianceIndex index = variance_index(model, fit.draws, fit.outside.posterior.weights,
                                             Rcpp::as<double>(control["probability"]), context);
  using Rcpp::_;
  return Rcpp::List::create(_["inside"] = list_inside(fit), _["outside"] = list_outside(fit, model),
                            _["index"] = list_index(index), _["log_jacobian"] = fit.log_jacobian);
}

// The fictitious condition x_0 of (6).
// [[Rcpp::export]]
Eigen::VectorXd fictitious_condition_(int n, double seed) {
  return fictitious_condition(n, static_cast<std::uint64_t>(seed));
}

// Posterior mean and variance of the discrepancy (N x draws, equation 8) for draws of the hyper-parameters of
// (6).
// [[Rcpp::export]]
Rcpp::List paper_discrepancy_(const Rcpp::List& data, const Rcpp::List& priors, const Rcpp::List& draws,
                              const Rcpp::List& context) {
  const KernelModel model(make_kernel_data(data), make_kernel_priors(priors));
  const std::vector<KernelDiscrepancy> found =
      discrepancies(model, make_draws(draws, model.priors().unit), convert::context(context));
  MatrixXd mean(model.size(), found.size()), variance(model.size(), found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    mean.col(static_cast<Eigen::Index>(i)) = found[i].mean;
    variance.col(static_cast<Eigen::Index>(i)) = found[i].variance;
  }
  return Rcpp::List::create(Rcpp::_["mean"] = mean, Rcpp::_["variance"] = variance);
}
