#include "network/Chebyshev.hpp"

#include <cmath>

namespace amiss::network {

namespace {

// T_0 ... T_degree at points of [-1, 1]: points x (degree + 1).
Eigen::MatrixXd polynomials(const Eigen::VectorXd& at, Eigen::Index degree) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Ones(at.size(), degree + 1);
  out.col(1) = at;
  for (Eigen::Index k = 2; k <= degree; ++k) {
    out.col(k) = 2.0 * at.cwiseProduct(out.col(k - 1)) - out.col(k - 2);
  }
  return out;
}

// Coefficients of the interpolant at the Chebyshev points of the first kind, by discrete orthogonality.
Eigen::MatrixXd interpolate(Eigen::Index degree, const std::function<Eigen::VectorXd(double)>& f) {
  const Eigen::Index count = degree + 1;
  const double pi = std::acos(-1.0);
  const Eigen::VectorXd points = ((Eigen::ArrayXd::LinSpaced(count, 0, static_cast<double>(degree)) + 0.5) *
                                  pi / static_cast<double>(count))
                                     .cos();
  Eigen::MatrixXd values;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::VectorXd value = f(points[i]);
    if (i == 0) values.resize(count, value.size());
    values.row(i) = value;
  }
  Eigen::MatrixXd out = polynomials(points, degree).transpose() * values * (2.0 / static_cast<double>(count));
  out.row(0) *= 0.5;
  return out;
}

}  // namespace

Chebyshev::Chebyshev(double lower, double upper, const std::function<Eigen::VectorXd(double)>& f)
    : middle_(0.5 * (lower + upper)), half_(0.5 * (upper - lower)) {
  const auto scaled = [&](double x) { return f(middle_ + half_ * x); };
  for (Eigen::Index degree = 8; degree <= 256 && !converged_; degree *= 2) {
    coefficients_ = interpolate(degree, scaled);
    const double last = coefficients_.bottomRows(3).cwiseAbs().maxCoeff();
    converged_ = last <= 1e-12 * coefficients_.cwiseAbs().maxCoeff();
  }
}

Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> Chebyshev::operator()(
    const Eigen::VectorXd& at) const {
  const Eigen::VectorXd scaled = (at.array() - middle_) / (half_ > 0.0 ? half_ : 1.0);
  return polynomials(scaled, coefficients_.rows() - 1) * coefficients_;
}

}  // namespace amiss::network
