#include "engine/ais/StudentT.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/linalg/constants.hpp"
#include "engine/linalg/log_gamma.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd weighted_covariance(const MatrixXd& x, const VectorXd& weights, const VectorXd& mean) {
  const MatrixXd scaled = (x.colwise() - mean) * weights.cwiseSqrt().asDiagonal();
  MatrixXd covariance = MatrixXd::Zero(x.rows(), x.rows());
  covariance.selfadjointView<Eigen::Lower>().rankUpdate(scaled);
  return covariance.selfadjointView<Eigen::Lower>();
}

// Lower Cholesky factor of a covariance estimated from `points` points, shrunk towards its diagonal.
MatrixXd shrunk_root(MatrixXd covariance, double points) {
  const double d = static_cast<double>(covariance.rows());
  const VectorXd diagonal = covariance.diagonal().cwiseMax(1e-12);
  covariance *= points / (points + d);
  covariance.diagonal() = diagonal;
  Eigen::LLT<MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) return diagonal.cwiseSqrt().asDiagonal();
  return factor.matrixL();
}

struct GaussianMixture {
  std::vector<double> weights;
  std::vector<VectorXd> means;
  std::vector<MatrixXd> roots;
  double bic = std::numeric_limits<double>::infinity();
};

// Log density of each column of x.
VectorXd log_gaussian(const MatrixXd& x, const VectorXd& mean, const MatrixXd& root) {
  MatrixXd z = x.colwise() - mean;
  root.triangularView<Eigen::Lower>().solveInPlace(z);
  const double log_constant =
      -root.diagonal().array().log().sum() - 0.5 * static_cast<double>(x.rows()) * std::log(2 * kPi);
  return (log_constant - 0.5 * z.colwise().squaredNorm().array()).transpose();
}

GaussianMixture fit_gaussian_mixture(const MatrixXd& x, const VectorXd& weights, int components,
                                     Stream& stream) {
  const Index n = x.cols(), d = x.rows();
  const double points = 1.0 / weights.squaredNorm();
  const VectorXd mean = x * weights;
  const MatrixXd covariance = weighted_covariance(x, weights, mean);
  const MatrixXd root = shrunk_root(covariance, points);

  GaussianMixture mixture;
  // Starting centres far from one another: each next one is drawn with probability proportional to the
  // squared distance (in the common scale) from the nearest so far.
  const MatrixXd white = root.triangularView<Eigen::Lower>().solve(x.colwise() - mean);
  VectorXd nearest = VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  Index chosen = 0;
  double u = stream.uniform();
  while (chosen < n - 1 && (u -= weights[chosen]) > 0) ++chosen;
  for (int k = 0; k < components; ++k) {
    if (k > 0) {
      const VectorXd mass = nearest.cwiseProduct(weights);
      u = stream.uniform() * mass.sum();
      for (chosen = 0; chosen < n - 1 && (u -= mass[chosen]) > 0;) ++chosen;
    }
    nearest = nearest.cwiseMin((white.colwise() - white.col(chosen)).colwise().squaredNorm().transpose());
    mixture.means.push_back(components == 1 ? mean : VectorXd(x.col(chosen)));
    mixture.roots.push_back(root);
    mixture.weights.push_back(1.0 / components);
  }
  double log_likelihood = -std::numeric_limits<double>::infinity();
  MatrixXd responsibility(n, components);
  for (int iteration = 0; iteration < (components == 1 ? 1 : 50); ++iteration) {
    for (int k = 0; k < components; ++k) {
      responsibility.col(k) =
          log_gaussian(x, mixture.means[k], mixture.roots[k]).array() + std::log(mixture.weights[k]);
    }
    const VectorXd log_density = log_sum_exp_rows(responsibility);
    const double total = points * weights.dot(log_density);
    responsibility = (responsibility.colwise() - log_density).array().exp().colwise() * weights.array();
    const bool settled = total - log_likelihood < 1e-3 * std::abs(total);
    log_likelihood = total;
    if (components == 1) break;
    for (int k = 0; k < components; ++k) {
      const double mass = responsibility.col(k).sum();
      if (mass * points < static_cast<double>(d) + 2.0)
        return {};  // a component too small to have a covariance
      const VectorXd share = responsibility.col(k) / mass;
      mixture.weights[k] = mass;
      mixture.means[k] = x * share;
      mixture.roots[k] = shrunk_root(weighted_covariance(x, share, mixture.means[k]), mass * points);
    }
    if (settled) break;
  }
  const double parameters = components * (1.0 + d + 0.5 * d * (d + 1.0)) - 1.0;
  mixture.bic = -2.0 * log_likelihood + parameters * std::log(points);
  return mixture;
}

}  // namespace

StudentT::StudentT(VectorXd location, MatrixXd root, double dof)
    : location_(std::move(location)), root_(std::move(root)), dof_(dof) {
  const double d = static_cast<double>(location_.size());
  log_constant_ = log_gamma(0.5 * (dof_ + d)) - log_gamma(0.5 * dof_) - 0.5 * d * std::log(dof_ * kPi) -
                  root_.diagonal().array().log().sum();
  inverse_root_ = MatrixXd::Identity(root_.rows(), root_.rows());
  root_.triangularView<Eigen::Lower>().solveInPlace(inverse_root_);
}

StudentT StudentT::fit(const MatrixXd& x, const VectorXd& weights, double dof) {
  const VectorXd mean = x * weights;
  const double points = 1.0 / weights.squaredNorm();
  return StudentT(mean, shrunk_root(weighted_covariance(x, weights, mean), points), dof);
}

MatrixXd StudentT::whiten(const MatrixXd& x) const { return inverse_root_ * (x.colwise() - location_); }

Eigen::ArrayXd StudentT::log_kernel(const MatrixXd& white) const {
  return -0.5 * (dof_ + static_cast<double>(white.rows())) *
         (white.colwise().squaredNorm().transpose().array() / dof_).log1p();
}

VectorXd StudentT::log_densities(const MatrixXd& x) const { return log_kernel(whiten(x)) + log_constant_; }

VectorXd StudentT::gradient(const VectorXd& x) const {
  const VectorXd z = whiten(x);
  const double weight = (dof_ + static_cast<double>(x.size())) / (dof_ + z.squaredNorm());
  return -weight * root_.transpose().triangularView<Eigen::Upper>().solve(z);
}

VectorXd StudentT::draw(Stream& stream) const {
  const double w = 0.5 * dof_ / stream.gamma(0.5 * dof_);
  return location_ +
         root_.triangularView<Eigen::Lower>() * VectorXd(std::sqrt(w) * stream.normals(location_.size()));
}

StudentT::Step StudentT::step(const MatrixXd& x, double s, Stream& stream) const {
  MatrixXd white = whiten(x);
  Step step{{}, log_kernel(white)};
  for (Index i = 0; i < x.cols(); ++i) {
    const double square = white.col(i).squaredNorm();
    const double w = 0.5 * (dof_ + square) / stream.gamma(0.5 * (dof_ + static_cast<double>(x.rows())));
    white.col(i) = std::sqrt(1.0 - s * s) * white.col(i) + s * std::sqrt(w) * stream.normals(x.rows());
  }
  step.back -= log_kernel(white).matrix();
  step.to = (root_ * white).colwise() + location_;
  return step;
}

StudentTMixture::StudentTMixture(std::vector<StudentT> components, std::vector<double> weights)
    : weights_(std::move(weights)), components_(std::move(components)) {
  if (components_.empty() || components_.size() != weights_.size())
    throw std::invalid_argument("Student-t mixture: one weight is needed for each component");
}

StudentTMixture StudentTMixture::fit(const MatrixXd& x, const VectorXd& weights, int max_components,
                                     double dof, Stream& stream) {
  GaussianMixture best;
  for (int k = 1; k <= max_components; ++k) {
    GaussianMixture candidate = fit_gaussian_mixture(x, weights, k, stream);
    if (k > 1 && !(candidate.bic < best.bic)) break;
    best = std::move(candidate);
  }
  std::vector<StudentT> components;
  for (std::size_t k = 0; k < best.means.size(); ++k)
    components.emplace_back(best.means[k], best.roots[k], dof);
  return StudentTMixture(std::move(components), std::move(best.weights));
}

StudentTMixture StudentTMixture::together(const std::vector<StudentTMixture>& mixtures) {
  std::vector<StudentT> components;
  std::vector<double> weights;
  for (const StudentTMixture& mixture : mixtures) {
    components.insert(components.end(), mixture.components_.begin(), mixture.components_.end());
    for (double weight : mixture.weights_) weights.push_back(weight / static_cast<double>(mixtures.size()));
  }
  return StudentTMixture(std::move(components), std::move(weights));
}

MatrixXd StudentTMixture::log_parts(const MatrixXd& x) const {
  MatrixXd parts(x.cols(), static_cast<Index>(components_.size()));
  for (std::size_t k = 0; k < components_.size(); ++k)
    parts.col(static_cast<Index>(k)) = components_[k].log_densities(x).array() + std::log(weights_[k]);
  return parts;
}

VectorXd StudentTMixture::log_densities(const MatrixXd& x) const { return log_sum_exp_rows(log_parts(x)); }

VectorXd StudentTMixture::gradient(const VectorXd& x) const {
  const VectorXd share = normalised_exp(log_parts(x).row(0).transpose());
  VectorXd gradient = VectorXd::Zero(x.size());
  for (std::size_t k = 0; k < components_.size(); ++k)
    gradient += share[static_cast<Index>(k)] * components_[k].gradient(x);
  return gradient;
}

VectorXd StudentTMixture::draw(Stream& stream) const {
  double u = stream.uniform();
  std::size_t k = 0;
  while (k + 1 < components_.size() && (u -= weights_[k]) > 0) ++k;
  return components_[k].draw(stream);
}

}  // namespace amiss
