#pragma once
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/discrepancy/KernelModel.hpp"
#include "helpers.hpp"

/// A record with its basis and conditions, points of the kernel model, and dense computations of the paper's
/// formulas.
namespace amiss::test {

constexpr Index kN = 48, kQ = 3;

/// Orthogonal columns of very different size; the last is the vector of ones.
inline MatrixXd make_basis_columns() {
  MatrixXd k(kN, kQ);
  k << normal_matrix(kN, 2, 61), VectorXd::Ones(kN);
  const Eigen::HouseholderQR<MatrixXd> qr(k.rowwise().reverse());
  MatrixXd o = qr.householderQ() * MatrixXd::Identity(kN, kQ);
  k.col(0) = 70.0 * o.col(1);
  k.col(1) = 0.4 * o.col(2);
  return k;
}

/// Three conditions, the second circular; y answers to the first.
inline KernelData make_data() {
  KernelData data;
  data.basis = make_basis_columns();
  data.conditions.resize(kN, 4);
  const VectorXd angle = 6.3 * uniform_matrix(kN, 1, 62);
  data.conditions << 30.0 * uniform_matrix(kN, 1, 63), angle.array().sin(), angle.array().cos(),
      normal_matrix(kN, 1, 64).array() + 500.0;
  data.condition = {0, 1, 1, 2};
  data.fictitious = fictitious_condition(kN, 5);
  data.y = data.basis * Eigen::Vector3d(0.02, 3.0, 21.0) + 0.3 * normal_vector(kN, 65);
  data.y.array() += (0.2 * data.conditions.col(0).array()).sin();
  return data;
}

inline KernelPriors make_priors() {
  KernelPriors priors;
  priors.noise.sd = 0.3;
  priors.noise.shape = 6.0;
  return priors;
}

inline KernelModel make_model(const KernelData& data = make_data()) {
  return KernelModel(data, make_priors());
}

inline KernelParameters make_point(const VectorXd& alpha, double t2, double lambda) {
  KernelParameters p;
  p.decay = -4.0 * alpha.array().log();
  p.amplitude = (1 - t2) / t2;
  p.lambda = lambda;
  return p;
}

inline std::vector<KernelParameters> make_points() {
  return {make_point(Eigen::Vector4d(0.2, 0.9, 0.99, 0.999), 0.5, 9.0),
          make_point(Eigen::Vector4d(0.9, 0.05, 1.0, 0.3), 0.02, 30.0),
          make_point(Eigen::Vector4d(0.999, 0.99, 0.6, 1 - 1e-9), 0.97, 3.0),
          make_point(Eigen::Vector4d(1.0, 1.0, 1.0, 1.0), 0.4, 11.0)};
}

/// zeta of (6) as it is written: powers of alpha, one pair of time steps after the other. `only` keeps one
/// condition.
inline MatrixXd dense_kernel(const KernelData& data, const KernelParameters& p, int only = -1) {
  const Index n = data.y.size(), columns = data.conditions.cols();
  const VectorXd alpha = p.alpha();
  MatrixXd x(n, columns + 1);
  x << data.conditions, data.fictitious;
  std::vector<int> condition = data.condition;
  condition.push_back(data.count());
  const VectorXd low = x.colwise().minCoeff(), high = x.colwise().maxCoeff();
  MatrixXd zeta(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      double product = (1 - p.t2()) / p.t2();
      for (Index c = 0; c <= columns; ++c) {
        double width = 0.0;
        for (Index d = 0; d <= columns; ++d) {
          if (condition[d] == condition[c]) width = std::max(width, high[d] - low[d]);
        }
        const double dx = (x(i, c) - x(j, c)) / width;
        if (only < 0 || condition[c] == only) product *= std::pow(alpha[condition[c]], 4 * dx * dx);
      }
      zeta(i, j) = product;
    }
  }
  return zeta;
}

/// H from a full decomposition of K.
inline MatrixXd complement(const MatrixXd& basis) {
  const Eigen::HouseholderQR<MatrixXd> qr(basis);
  const MatrixXd q = qr.householderQ();
  return q.rightCols(basis.rows() - basis.cols());
}

inline double cdf_normal(double x) { return cdf(boost::math::normal(), x); }

/// log of the integral of exp(f) times the standard normal density; trapezoidal rule, accurate to rounding.
inline double quadrature(const std::function<double(double)>& f) {
  const int m = 600;
  const double h = 18.0 / m;
  VectorXd terms(m + 1);
  for (int i = 0; i <= m; ++i) {
    const double x = -9 + h * i;
    terms[i] = f(x) - 0.5 * (x * x + kLogTwoPi);
  }
  const double top = terms.maxCoeff();
  return top + std::log((terms.array() - top).exp().sum() * h);
}

}  // namespace amiss::test
