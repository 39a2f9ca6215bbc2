#include "engine/discrepancy/CoefficientLikelihood.hpp"

#include <limits>
#include <utility>

namespace amiss {

using Eigen::MatrixXd;
using Eigen::VectorXd;

CoefficientLikelihood::CoefficientLikelihood(VectorXd reference, MatrixXd information, VectorXd score,
                                             double log_density)
    : reference_(std::move(reference)),
      information_(std::move(information)),
      score_(std::move(score)),
      log_density_(log_density) {}

Eigen::LLT<MatrixXd> CoefficientLikelihood::factor(const VectorXd& root) const {
  MatrixXd matrix = root.asDiagonal() * information_ * root.asDiagonal();
  matrix.diagonal().array() += 1.0;
  return Eigen::LLT<MatrixXd>(matrix);
}

double CoefficientLikelihood::log_density(const VectorXd& mean, const VectorXd& variance) const {
  const VectorXd root = variance.cwiseSqrt(), d = mean - reference_;
  const Eigen::LLT<MatrixXd> f = factor(root);
  if (f.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const VectorXd pulled = information_ * d, left = score_ - pulled;
  const VectorXd half = f.matrixL().solve(root.cwiseProduct(left));
  return log_density_ + d.dot(score_) - 0.5 * d.dot(pulled) - f.matrixLLT().diagonal().array().log().sum() +
         0.5 * half.squaredNorm();
}

VectorXd CoefficientLikelihood::score(const VectorXd& w) const {
  return score_ - information_ * (w - reference_);
}

// With H = F^-1/2 S^1/2: A - (HA)'HA, c - (HA)'Hc, and log|F| and Hc in the value at w0.
CoefficientLikelihood CoefficientLikelihood::blurred(const VectorXd& variance) const {
  const VectorXd root = variance.cwiseSqrt();
  const Eigen::LLT<MatrixXd> f = factor(root);
  const MatrixXd half = f.matrixL().solve(root.asDiagonal() * information_);
  const VectorXd pulled = f.matrixL().solve(root.cwiseProduct(score_));
  return {reference_, information_ - half.transpose() * half, score_ - half.transpose() * pulled,
          log_density_ - f.matrixLLT().diagonal().array().log().sum() + 0.5 * pulled.squaredNorm()};
}

CoefficientLikelihood::Posterior CoefficientLikelihood::posterior() const {
  const Eigen::LLT<MatrixXd> f = factor(VectorXd::Ones(score_.size()));
  return {f.solve(score_ + information_ * reference_),
          f.solve(MatrixXd::Identity(score_.size(), score_.size()))};
}

MatrixXd CoefficientLikelihood::information(const VectorXd& variance) const {
  return blurred(variance).information_;
}

}  // namespace amiss
