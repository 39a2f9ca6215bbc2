#include "helpers.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/ais/StandardNormal.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss::test {

MatrixXd normal_matrix(Index rows, Index columns, unsigned seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, columns, [&] { return normal(engine); });
}

MatrixXd uniform_matrix(Index rows, Index columns, unsigned seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform;
  return MatrixXd::NullaryExpr(rows, columns, [&] { return uniform(engine); });
}

VectorXd normal_vector(Index n, unsigned seed) { return normal_matrix(n, 1, seed); }

double log_normal_density(const VectorXd& y, const VectorXd& mean, const MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  const VectorXd z = eigen.eigenvectors().transpose() * (y - mean);
  return -0.5 * (static_cast<double>(y.size()) * kLogTwoPi + eigen.eigenvalues().array().log().sum() +
                 (z.array().square() / eigen.eigenvalues().array()).sum());
}

MatrixXd error_covariance(const TimeAxis& axis, const VectorXd& correlation_times, const VectorXd& ratios) {
  const Index n = axis.size();
  std::vector<int> segment(static_cast<std::size_t>(n));
  int current = 0;
  for (Index i = 0; i < n; ++i) segment[i] = current += axis.new_segment[i] ? 1 : 0;
  MatrixXd c = MatrixXd::Identity(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      if (segment[i] != segment[j]) continue;
      for (Index k = 0; k < ratios.size(); ++k) {
        c(i, j) += ratios[k] * std::exp(-std::abs(axis.time[i] - axis.time[j]) / correlation_times[k]);
      }
    }
  }
  return c;
}

TimeAxis uneven_axis(Index n, const std::vector<Index>& breaks, unsigned seed) {
  TimeAxis axis{VectorXd(n), std::vector<bool>(static_cast<std::size_t>(n), false)};
  const VectorXd steps = (uniform_matrix(n, 1, seed).array() + 0.2).matrix();
  axis.new_segment[0] = true;
  for (Index b : breaks) axis.new_segment[static_cast<std::size_t>(b)] = true;
  for (Index i = 0; i < n; ++i) axis.time[i] = axis.new_segment[i] ? 0.0 : axis.time[i - 1] + steps[i];
  return axis;
}

TimeAxis even_axis(Index n) {
  TimeAxis axis{VectorXd::LinSpaced(n, 0.0, static_cast<double>(n - 1)),
                std::vector<bool>(static_cast<std::size_t>(n), false)};
  axis.new_segment[0] = true;
  return axis;
}

VectorXd numerical_gradient(const std::function<double(const VectorXd&)>& f, const VectorXd& x, double h) {
  VectorXd gradient(x.size());
  for (Index i = 0; i < x.size(); ++i) {
    VectorXd up = x, down = x;
    up[i] += h;
    down[i] -= h;
    gradient[i] = (f(up) - f(down)) / (2 * h);
  }
  return gradient;
}

double kolmogorov_distance(std::vector<double> sample, const std::function<double(double)>& cdf) {
  std::sort(sample.begin(), sample.end());
  const double n = static_cast<double>(sample.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const double p = cdf(sample[i]);
    distance = std::max(
        {distance, std::abs(p - static_cast<double>(i) / n), std::abs(p - static_cast<double>(i + 1) / n)});
  }
  return distance;
}

VectorXd FunctionTarget::log_likelihood(const MatrixXd& x) const {
  VectorXd values(x.cols());
  for (Index i = 0; i < x.cols(); ++i) values[i] = f_(x.col(i));
  return values;
}

double evidence_by_quadrature(const Target& target) {
  const int m = 400;
  const double h = 16.0 / m;
  VectorXd log_terms((m + 1) * (m + 1));
  MatrixXd row(2, m + 1);
  for (int i = 0; i <= m; ++i) {
    for (int j = 0; j <= m; ++j) row.col(j) = Eigen::Vector2d(-8 + h * i, -8 + h * j);
    log_terms.segment(i * (m + 1), m + 1) = target.log_likelihood(row) + StandardNormal::at(row);
  }
  return log_sum_exp(log_terms) + 2.0 * std::log(h);
}

}  // namespace amiss::test
