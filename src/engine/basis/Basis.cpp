#include "engine/basis/Basis.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace amiss {

void BasisOptions::check() const {
  if (!(explained > 0 && explained <= 1)) throw std::invalid_argument("basis: explained must lie in (0, 1]");
  if (!(noise_sd >= 0)) throw std::invalid_argument("basis: noise_sd must not be negative");
  if (!(noise_fraction > 0)) throw std::invalid_argument("basis: noise_fraction must be positive");
  if (max_vectors < 2) throw std::invalid_argument("basis: max_vectors must be at least 2");
}

Basis make_basis(const Eigen::Ref<const Eigen::MatrixXd>& outputs, const BasisOptions& options) {
  options.check();
  const Eigen::Index n = outputs.rows(), m = outputs.cols();
  if (n < 3 || m < 3) throw std::invalid_argument("basis: at least 3 time steps and 3 runs are needed");
  const Eigen::RowVectorXd means = outputs.colwise().mean();
  const Eigen::MatrixXd centred = outputs.rowwise() - means;

  // The squared singular values are the eigenvalues of the M x M Gram matrix; what this loses, below 1e-7 of
  // the largest singular value, lies far under any truncation rule.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(centred.transpose() * centred);
  const Eigen::VectorXd energy = gram.eigenvalues().reverse().cwiseMax(0.0);
  const double total = energy.sum();
  const double tiny = 1e-14 * energy[0];
  if (!(total > 0) || !std::isfinite(total))
    throw std::invalid_argument("basis: the runs do not vary over time");

  const double allowed_ss = options.noise_sd > 0 ? std::pow(options.noise_fraction * options.noise_sd, 2) *
                                                       static_cast<double>(n * m)
                                                 : total;
  const Eigen::Index limit = std::min<Eigen::Index>({options.max_vectors - 1, m - 1, n - 2});
  Eigen::Index kept = 0;
  double rest = total;
  while (kept < limit && energy[kept] > tiny &&
         (rest > (1 - options.explained) * total || rest > allowed_ss)) {
    rest -= energy[kept++];
  }
  rest = std::max(rest, 0.0);

  Basis basis;
  basis.singular_values = energy.head(std::min(n, m)).cwiseSqrt();
  basis.coefficients.resize(m, kept + 1);
  basis.coefficients.leftCols(kept) = gram.eigenvectors().rowwise().reverse().leftCols(kept);
  basis.coefficients.col(kept) = means.transpose();
  basis.vectors.resize(n, kept + 1);
  basis.vectors.leftCols(kept) = centred * basis.coefficients.leftCols(kept);
  basis.vectors.col(kept).setOnes();
  basis.explained = 1.0 - rest / total;
  basis.discarded_ss = rest;
  basis.discarded_rms = std::sqrt(rest / static_cast<double>(n * m));
  return basis;
}

}  // namespace amiss
