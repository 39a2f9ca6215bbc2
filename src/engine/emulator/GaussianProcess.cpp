#include "engine/emulator/GaussianProcess.hpp"

#include <algorithm>
#include <boost/math/special_functions/trigamma.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "engine/emulator/ModeSearch.hpp"
#include "engine/linalg/GaussianKernel.hpp"
#include "engine/linalg/log_gamma.hpp"
#include "engine/linalg/triangular.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kJitter = 1e-10;          // of the amplitude: keeps the Cholesky factor away from rounding
constexpr double kGreatestLeverage = 0.9;  // beyond which a Newton step leads too far

// beta^(4 d^2) = exp(-theta d^2) with theta = -4 log(beta) = 4 log(1 + exp(-logit beta)).
VectorXd decay_rates(const VectorXd& logit_beta) {
  return logit_beta.unaryExpr(
      [](double b) { return b > 0 ? 4 * std::log1p(std::exp(-b)) : 4 * (std::log1p(std::exp(b)) - b); });
}

double noise_variance(const GaussianProcessParameters& p) {
  return std::exp(p.log_nugget) + (std::isfinite(p.log_lambda) ? std::exp(-p.log_lambda) : 0.0);
}

// Of inputs already scaled by sqrt(theta_p): prod_p beta_p^(4 (a_ip - b_jp)^2) is a Gaussian kernel in them.
void fill_covariance(const MatrixXd& scaled, const GaussianProcessParameters& p, Eigen::Ref<MatrixXd> c) {
  gaussian_kernel(scaled, scaled, c);
  c *= std::exp(p.log_amplitude);
  c.diagonal().array() += noise_variance(p) + kJitter * std::exp(p.log_amplitude);
}

// log Beta(x; a, b) at x = 1 / (1 + exp(-t)), as a density of x, and its derivative by t.
double log_beta_density(const BetaShapes& prior, double t, double& slope) {
  const double log_x = t > 0 ? -std::log1p(std::exp(-t)) : t - std::log1p(std::exp(t));
  const double log_rest = log_x - t;  // log(1 - x)
  slope = (prior.a - 1) * std::exp(log_rest) - (prior.b - 1) * std::exp(log_x);
  const double log_constant = log_gamma(prior.a + prior.b) - log_gamma(prior.a) - log_gamma(prior.b);
  return log_constant + (prior.a - 1) * log_x + (prior.b - 1) * log_rest;
}

// Log prior density of the hyper-parameters at x, whose betas may be fewer than the inputs; the gradient is
// added.
double log_prior(const HyperPriors& priors, const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
  double value = 0.0;
  const auto add = [&](Index i, const BetaShapes& prior, double sign) {
    double slope = 0.0;
    value += log_beta_density(prior, sign * x[i], slope);
    if (gradient.size() > 0) gradient[i] += sign * slope;
  };
  add(0, priors.s2, -1.0);
  add(1, priors.eta2, -1.0);
  for (Index i = 3; i < x.size(); ++i) add(i, priors.beta, 1.0);
  if (priors.lambda.shape > 0) {
    const double lambda = std::exp(x[2]);
    value += (priors.lambda.shape - 1) * x[2] - priors.lambda.rate * lambda;
    if (gradient.size() > 0) gradient[2] += priors.lambda.shape - 1 - priors.lambda.rate * lambda;
  }
  return value;
}

// 1 / variance of the logit of a Beta variable, of the logarithm of a Gamma variable.
double logit_precision(const BetaShapes& prior) {
  return 1.0 / (boost::math::trigamma(prior.a) + boost::math::trigamma(prior.b));
}
double log_precision(const GammaPrior& prior) {
  return prior.shape > 0 ? 1.0 / boost::math::trigamma(prior.shape)
                         : 1.0;  // nothing hangs on what is left out
}

VectorXd prior_precisions(const HyperPriors& priors, Index n_betas) {
  VectorXd out = VectorXd::Constant(3 + n_betas, logit_precision(priors.beta));
  out.head(3) << logit_precision(priors.s2), logit_precision(priors.eta2), log_precision(priors.lambda);
  return out;
}

// Log density of the values, up to a constant, and its gradient in pack()'s coordinates.
double log_likelihood(const MatrixXd& inputs, const VectorXd& values, const VectorXd& packed,
                      Eigen::Ref<VectorXd> gradient, GaussianProcess::Memory& memory) {
  const Index n = inputs.rows();
  const auto p = GaussianProcessParameters::unpack(packed);
  const VectorXd theta = decay_rates(p.logit_beta);
  const MatrixXd scaled = inputs * theta.cwiseSqrt().asDiagonal();
  auto c = memory.covariance.matrix(n, n), inverse = memory.inverse.matrix(n, n);
  fill_covariance(scaled, p, c);
  inverse = c;
  Eigen::Ref<MatrixXd> in_place(inverse);
  const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(in_place);
  if (factor.info() != Eigen::Success) {
    gradient.setZero();
    return -std::numeric_limits<double>::infinity();
  }
  const VectorXd weights = factor.solve(values);
  const double log_det = 2.0 * inverse.diagonal().array().log().sum();

  if (gradient.size() > 0) {
    // d value / d theta_j = 1/2 tr[(w w' - C^-1) dC/dtheta_j] (Rasmussen and Williams 2006, equation 5.9).
    invert_lower(inverse);
    square_lower(inverse);
    symmetrise(inverse);
    const double trace = weights.squaredNorm() - inverse.trace();
    c.diagonal().array() -= noise_variance(p);
    auto& sensitivity = inverse;
    for (Index j = 0; j < n; ++j)
      sensitivity.col(j) = (weights * weights[j] - inverse.col(j)).cwiseProduct(c.col(j));
    gradient[0] = 0.5 * sensitivity.sum();
    gradient[1] = 0.5 * trace * std::exp(p.log_nugget);
    gradient[2] = -0.5 * trace / std::exp(p.log_lambda);
    // sum_ij S_ij (u_ip - u_jp)^2 = 2 [sum_i u_ip^2 (S 1)_i - u_p' S u_p], S symmetric.
    const VectorXd row_sums = sensitivity.colwise().sum();
    const MatrixXd product = sensitivity * inputs;
    for (Index j = 0; j < inputs.cols(); ++j) {
      const double squared =
          2.0 * (inputs.col(j).cwiseAbs2().dot(row_sums) - inputs.col(j).dot(product.col(j)));
      // d theta / d logit(beta) = -4 (1 - beta).
      gradient[3 + j] = 0.5 * squared * 4.0 / (1.0 + std::exp(p.logit_beta[j]));
    }
  }
  return -0.5 * log_det - 0.5 * values.dot(weights);
}

}  // namespace

void HyperPriors::check() const {
  for (const BetaShapes& prior : {s2, eta2, beta}) {
    if (!(prior.a >= 1 && prior.b >= 1) || !std::isfinite(prior.a + prior.b))
      throw std::invalid_argument("emulator: the shapes of a beta prior must be at least 1");
  }
  if (!(lambda.shape >= 0 && lambda.rate >= 0))
    throw std::invalid_argument("emulator: shape and rate of the prior of lambda must not be negative");
}

VectorXd GaussianProcessParameters::pack() const {
  VectorXd x(logit_beta.size() + 3);
  x << log_amplitude, log_nugget, log_lambda, logit_beta;
  return x;
}

GaussianProcessParameters GaussianProcessParameters::unpack(const VectorXd& x) {
  return {x[0], x[1], x[2], x.tail(x.size() - 3)};
}

GaussianProcess::GaussianProcess(const MatrixXd& inputs, const VectorXd& values,
                                 const GaussianProcessParameters& parameters)
    : input_scale_(decay_rates(parameters.logit_beta).cwiseSqrt()),
      scaled_inputs_(inputs * input_scale_.asDiagonal()),
      values_(values),
      parameters_(parameters) {
  beta_of.resize(static_cast<std::size_t>(inputs.cols()));
  std::iota(beta_of.begin(), beta_of.end(), 0);
  MatrixXd covariance(inputs.rows(), inputs.rows());
  fill_covariance(scaled_inputs_, parameters_, covariance);
  const Eigen::LLT<MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success)
    throw std::runtime_error("emulator: covariance is not positive definite");
  root_inverse_ = factor.matrixL();
  invert_lower(root_inverse_);
  inverse_ = root_inverse_;
  square_lower(inverse_);
  symmetrise(inverse_);
  weights_ = inverse_ * values_;
}

double GaussianProcess::log_density(const MatrixXd& inputs, const VectorXd& values, const HyperPriors& priors,
                                    const VectorXd& packed, Eigen::Ref<VectorXd> gradient) {
  Memory memory;
  const double value = log_likelihood(inputs, values, packed, gradient, memory);
  return value + log_prior(priors, packed, gradient);
}

double GaussianProcess::log_density(const MatrixXd& inputs, const VectorXd& values, const HyperPriors& priors,
                                    const std::vector<int>& beta_of, const VectorXd& x,
                                    Eigen::Ref<VectorXd> gradient, Memory& memory) {
  const Index n = inputs.cols();
  VectorXd packed(n + 3), slope(gradient.size() > 0 ? n + 3 : 0);
  packed.head(3) = x.head(3);
  for (Index p = 0; p < n; ++p) packed[3 + p] = x[3 + beta_of[p]];
  const double value = log_likelihood(inputs, values, packed, slope, memory);
  if (gradient.size() > 0) {
    gradient.setZero();
    gradient.head(3) = slope.head(3);
    for (Index p = 0; p < n; ++p) gradient[3 + beta_of[p]] += slope[3 + p];
  }
  return value + log_prior(priors, x, gradient);
}

GaussianProcess GaussianProcess::fit(const MatrixXd& inputs, const VectorXd& values,
                                     const HyperPriors& priors, const SearchOptions& options) {
  const Mode mode = find_mode(inputs, values, priors, options);
  GaussianProcess process(inputs, values, mode.parameters);
  process.log_joint = mode.value;
  process.evaluations = mode.evaluations;
  process.selection = mode.selection;
  process.beta_of = mode.beta_of;
  return process;
}

double GaussianProcess::noise() const { return noise_variance(parameters_); }

void GaussianProcess::predict(const MatrixXd& points, Eigen::Ref<VectorXd> mean,
                              Eigen::Ref<VectorXd> variance) const {
  const MatrixXd scaled = points * input_scale_.asDiagonal();
  const double amplitude = std::exp(parameters_.log_amplitude);
  const MatrixXd kernel = gaussian_kernel(scaled_inputs_, scaled);  // M x n
  mean.noalias() = amplitude * (kernel.transpose() * weights_);
  const MatrixXd half = root_inverse_.triangularView<Eigen::Lower>() * kernel;
  const double squared = amplitude * amplitude;
  variance =
      (amplitude - squared * half.colwise().squaredNorm().array()).max(kJitter * amplitude).transpose();
}

void GaussianProcess::predict(const MatrixXd& points, Eigen::Ref<VectorXd> mean) const {
  const MatrixXd scaled = points * input_scale_.asDiagonal();
  mean.noalias() =
      std::exp(parameters_.log_amplitude) * (gaussian_kernel(scaled_inputs_, scaled).transpose() * weights_);
}

// d/ds exp(-|u_i - s|^2) = 2 (u_i - s) exp(-|u_i - s|^2) at the scaled point s.
void GaussianProcess::predict(const MatrixXd& points, Eigen::Ref<VectorXd> mean, MatrixXd& slopes) const {
  const MatrixXd scaled = points * input_scale_.asDiagonal();
  MatrixXd share = gaussian_kernel(scaled_inputs_, scaled);  // of run i in the mean at point j
  share.array().colwise() *= std::exp(parameters_.log_amplitude) * weights_.array();
  mean = share.colwise().sum().transpose();
  slopes.noalias() = share.transpose() * scaled_inputs_;
  slopes -= mean.asDiagonal() * scaled;
  slopes = 2.0 * slopes * input_scale_.asDiagonal();
}

void GaussianProcess::leave_one_out(VectorXd& mean, VectorXd& variance) const {
  variance = inverse_.diagonal().cwiseInverse();
  mean = values_ - weights_.cwiseProduct(variance);
}

// By the hyper-parameters, of which those of shared betas are one.
struct GaussianProcess::Slopes {
  MatrixXd error;         // of each leave-one-out error, one row a value
  VectorXd log_variance;  // of the logarithm of the leave-one-out variances, mean over the values
  MatrixXd information;   // about the hyper-parameters
};

// With C the covariance, dC its derivative and p_i the diagonal of C^-1, e_i = (C^-1 y)_i / p_i and
//     de_i = -(C^-1 dC C^-1 y)_i / p_i + e_i d log v_i,   d log v_i = (C^-1 dC C^-1)_ii / p_i.
GaussianProcess::Slopes GaussianProcess::slopes(const HyperPriors& priors, const VectorXd& error) const {
  const Index n = values_.size(), inputs = scaled_inputs_.cols();
  const double nugget = std::exp(parameters_.log_nugget), rest = noise() - nugget;
  const VectorXd& w = weights_;
  const VectorXd spread = inverse_.diagonal().cwiseInverse();
  MatrixXd work = inverse_ * spread.cwiseSqrt().asDiagonal();
  MatrixXd share = MatrixXd::Zero(n, n);  // of each element of dC in the mean of d log v_i
  share.selfadjointView<Eigen::Lower>().rankUpdate(work, 1.0 / static_cast<double>(n));
  symmetrise(share);
  const double trace = share.trace();

  const Index betas = 1 + *std::max_element(beta_of.begin(), beta_of.end());
  MatrixXd moved = MatrixXd::Zero(n, 3 + betas);  // dC C^-1 y
  VectorXd log_variance = VectorXd::Zero(3 + betas);
  moved.leftCols(3) << values_ - noise() * w, nugget * w, -rest * w;
  log_variance.head(3) << 1.0 - noise() * trace, nugget * trace, -rest * trace;

  // dC_ij = C_ij f (u_i - u_j)^2 with the scaled inputs u, multiplied out.
  auto& smooth = work;
  gaussian_kernel(scaled_inputs_, scaled_inputs_, smooth);
  smooth *= std::exp(parameters_.log_amplitude);
  share = share.cwiseProduct(smooth);
  const MatrixXd& u = scaled_inputs_;
  const MatrixXd squared = u.cwiseAbs2();
  const VectorXd direct = smooth * w, row_sums = share.rowwise().sum();
  const MatrixXd once = smooth * (w.asDiagonal() * u), twice = smooth * (w.asDiagonal() * squared);
  const MatrixXd shared = share * u;
  const VectorXd rates = decay_rates(parameters_.logit_beta);
  for (Index p = 0; p < inputs; ++p) {
    const double f = 4.0 / (1.0 + std::exp(parameters_.logit_beta[p])) / rates[p];
    const Index k = 3 + beta_of[static_cast<std::size_t>(p)];
    moved.col(k) +=
        f * (squared.col(p).cwiseProduct(direct) + twice.col(p) - 2.0 * u.col(p).cwiseProduct(once.col(p)));
    log_variance[k] += 2.0 * f * (squared.col(p).dot(row_sums) - u.col(p).dot(shared.col(p)));
  }

  const MatrixXd half = root_inverse_.triangularView<Eigen::Lower>() * moved;
  const MatrixXd solved = root_inverse_.triangularView<Eigen::Lower>().transpose() * half;
  MatrixXd information = 0.5 * half.transpose() * half;
  information.diagonal() += prior_precisions(priors, betas);
  return {error * log_variance.transpose() - spread.asDiagonal() * solved, log_variance, information};
}

void GaussianProcess::leave_one_out(const HyperPriors& priors, VectorXd& mean, VectorXd& variance) const {
  leave_one_out(mean, variance);
  const VectorXd error = values_ - mean;
  const Slopes slope = slopes(priors, error);
  const VectorXd& b = slope.log_variance;
  const Eigen::LLT<MatrixXd> information(slope.information);
  for (Index i = 0; i < values_.size(); ++i) {
    const VectorXd a = slope.error.row(i).transpose();
    const double v = variance[i], e = error[i];
    const VectorXd score = -(e / v) * a - 0.5 * (1.0 - e * e / v) * b;
    const VectorXd step = information.solve(score), leverage = information.solve(a) / v;
    const double change =
        a.dot(step) / (1.0 - std::min(kGreatestLeverage, a.dot(leverage)));  // Sherman, Morrison
    mean[i] += change;
    variance[i] *= std::exp(-b.dot(step) - b.dot(leverage) * change);
  }
}

void GaussianProcess::widen(const HyperPriors& priors) {
  leave_one_out(priors, left_out_mean, left_out_variance);
  const double factor = ((values_ - left_out_mean).array().square() / left_out_variance.array()).mean();
  if (!(factor > 1.0)) return;
  widened = factor;
  left_out_variance *= factor;
  parameters_.log_amplitude += std::log(factor);
  parameters_.log_nugget += std::log(factor);
  parameters_.log_lambda -= std::log(factor);
  inverse_ /= factor;
  root_inverse_ /= std::sqrt(factor);
  weights_ /= factor;
}

}  // namespace amiss
