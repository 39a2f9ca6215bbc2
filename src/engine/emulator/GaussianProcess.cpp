#include "engine/emulator/GaussianProcess.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "engine/optimise/maximise.hpp"

namespace amiss {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kJitter = 1e-10;  // of the amplitude: keeps the Cholesky factor away from rounding

// beta^(4 d^2) = exp(-theta d^2) with theta = -4 log(beta) = 4 log(1 + exp(-logit beta)).
VectorXd decay_rates(const VectorXd& logit_beta) {
  return logit_beta.unaryExpr(
      [](double b) { return b > 0 ? 4 * std::log1p(std::exp(-b)) : 4 * (std::log1p(std::exp(b)) - b); });
}

// prod_p beta_p^(4 (a_ip - b_jp)^2) for inputs already scaled by sqrt(theta_p): one matrix product and one
// exp.
MatrixXd correlation(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd r = 2.0 * a * b.transpose();
  r.colwise() -= a.rowwise().squaredNorm();
  r.rowwise() -= b.rowwise().squaredNorm().transpose();
  return r.array().min(0.0).exp();
}

double noise(const GaussianProcessParameters& p) {
  return std::exp(p.log_nugget) + (std::isfinite(p.log_lambda) ? std::exp(-p.log_lambda) : 0.0);
}

MatrixXd covariance(const MatrixXd& scaled, const GaussianProcessParameters& p) {
  MatrixXd c = std::exp(p.log_amplitude) * correlation(scaled, scaled);
  c.diagonal().array() += noise(p) + kJitter * std::exp(p.log_amplitude);
  return c;
}

struct Box {
  VectorXd lower, upper;
};

Box search_box(Eigen::Index n_inputs, const GammaPrior& prior) {
  Box box{VectorXd::Constant(n_inputs + 3, -9.0), VectorXd::Constant(n_inputs + 3, 14.0)};
  box.lower.head(3) << -6.0, -25.0, -5.0;
  box.upper.head(3) << 14.0, 2.0, 40.0;
  if (prior.shape <= 0) box.lower[2] = box.upper[2] = 40.0;
  return box;
}

}  // namespace

void EmulatorOptions::check() const {
  if (starts < 1 || searches < 1 || searches > starts)
    throw std::invalid_argument("emulator: need 1 <= searches <= starts");
  if (max_evaluations < 1) throw std::invalid_argument("emulator: max_evaluations must be positive");
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
    : scaled_inputs_(inputs * decay_rates(parameters.logit_beta).cwiseSqrt().asDiagonal()),
      values_(values),
      parameters_(parameters) {
  const Eigen::LLT<MatrixXd> factor(covariance(scaled_inputs_, parameters_));
  if (factor.info() != Eigen::Success)
    throw std::runtime_error("emulator: covariance is not positive definite");
  root_inverse_ = MatrixXd::Identity(values.size(), values.size());
  factor.matrixL().solveInPlace(root_inverse_);
  inverse_.noalias() = root_inverse_.transpose() * root_inverse_;
  weights_ = inverse_ * values_;
}

double GaussianProcess::log_density(const MatrixXd& inputs, const VectorXd& values, const GammaPrior& prior,
                                    const VectorXd& packed, Eigen::Ref<VectorXd> gradient) {
  const auto p = GaussianProcessParameters::unpack(packed);
  const VectorXd theta = decay_rates(p.logit_beta);
  const MatrixXd scaled = inputs * theta.cwiseSqrt().asDiagonal();
  MatrixXd c = covariance(scaled, p);
  const Eigen::LLT<MatrixXd> factor(c);
  if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const VectorXd weights = factor.solve(values);
  const double log_det = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  const double lambda = std::exp(p.log_lambda);
  double value = -0.5 * log_det - 0.5 * values.dot(weights);
  if (prior.shape > 0) value += (prior.shape - 1) * p.log_lambda - prior.rate * lambda;

  if (gradient.size() > 0) {
    // d value / d theta_j = 1/2 tr[(w w' - C^-1) dC/dtheta_j] (Rasmussen and Williams 2006, equation 5.9).
    MatrixXd sensitivity = -factor.solve(MatrixXd::Identity(c.rows(), c.cols()));
    sensitivity.noalias() += weights * weights.transpose();
    const double trace = sensitivity.trace();
    c.diagonal().array() -= noise(p);
    sensitivity.array() *= c.array();
    gradient[0] = 0.5 * sensitivity.sum();
    gradient[1] = 0.5 * trace * std::exp(p.log_nugget);
    gradient[2] = -0.5 * trace / lambda + (prior.shape > 0 ? prior.shape - 1 - prior.rate * lambda : 0.0);
    // sum_ij S_ij (u_ip - u_jp)^2 = 2 [sum_i u_ip^2 (S 1)_i - u_p' S u_p], S symmetric.
    const VectorXd row_sums = sensitivity.rowwise().sum();
    const MatrixXd product = sensitivity * inputs;
    for (Eigen::Index j = 0; j < inputs.cols(); ++j) {
      const double squared =
          2.0 * (inputs.col(j).cwiseAbs2().dot(row_sums) - inputs.col(j).dot(product.col(j)));
      // d theta / d logit(beta) = -4 (1 - beta).
      gradient[3 + j] = 0.5 * squared * 4.0 / (1.0 + std::exp(p.logit_beta[j]));
    }
  }
  return value;
}

GaussianProcess GaussianProcess::fit(const MatrixXd& inputs, const VectorXd& values, const GammaPrior& prior,
                                     const EmulatorOptions& options) {
  options.check();
  const Box box = search_box(inputs.cols(), prior);
  const double log_lambda =
      prior.shape > 1 ? std::log((prior.shape - 1) / prior.rate) : (prior.shape > 0 ? 10.0 : 40.0);
  // Starting points from nearly linear to rough responses.
  std::vector<Maximum> candidates;
  for (int s = 0; s < options.starts; ++s) {
    const double logit_beta = 3.5 - 5.0 * s / std::max(1, options.starts - 1);
    GaussianProcessParameters p{s == 0 ? 3.0 : 1.0, -9.0,
                                std::min(std::max(log_lambda, box.lower[2]), box.upper[2]),
                                VectorXd::Constant(inputs.cols(), logit_beta)};
    VectorXd none(0);
    candidates.push_back({p.pack(), log_density(inputs, values, prior, p.pack(), none), 1, false});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Maximum& a, const Maximum& b) { return a.value > b.value; });
  const Objective objective = [&](const VectorXd& x, Eigen::Ref<VectorXd> gradient) {
    return log_density(inputs, values, prior, x, gradient);
  };
  Maximum best;
  best.value = -std::numeric_limits<double>::infinity();
  int evaluations = options.starts;
  for (int s = 0; s < options.searches; ++s) {
    Maximum found = maximise(objective, candidates[s].x, box.lower, box.upper, 1e-7, options.max_evaluations);
    evaluations += found.evaluations;
    if (found.value > best.value) best = found;
  }
  if (!std::isfinite(best.value)) throw std::runtime_error("emulator: no usable hyper-parameters were found");
  GaussianProcess process(inputs, values, GaussianProcessParameters::unpack(best.x));
  process.log_joint = best.value;
  process.evaluations = evaluations;
  return process;
}

void GaussianProcess::predict(const MatrixXd& points, Eigen::Ref<VectorXd> mean,
                              Eigen::Ref<VectorXd> variance) const {
  const MatrixXd scaled = points * decay_rates(parameters_.logit_beta).cwiseSqrt().asDiagonal();
  const double amplitude = std::exp(parameters_.log_amplitude);
  const MatrixXd cross = amplitude * correlation(scaled_inputs_, scaled);  // M x n
  mean.noalias() = cross.transpose() * weights_;
  const MatrixXd half = root_inverse_.triangularView<Eigen::Lower>() * cross;
  variance = (amplitude - half.colwise().squaredNorm().array()).max(kJitter * amplitude).matrix().transpose();
}

void GaussianProcess::leave_one_out(VectorXd& mean, VectorXd& variance) const {
  variance = inverse_.diagonal().cwiseInverse();
  mean = values_ - weights_.cwiseProduct(variance);
}

}  // namespace amiss
