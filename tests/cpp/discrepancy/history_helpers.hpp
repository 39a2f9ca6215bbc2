#pragma once
#include <algorithm>
#include <cmath>

#include "engine/discrepancy/HistoryTarget.hpp"
#include "helpers.hpp"

/// A record of three conditions, its model under nine errors and three reaches, and the density of the record
/// by N x N matrices.
namespace amiss::test {

constexpr Index kN = 40, kQ = 3;
constexpr double kNoise = 0.7;
inline const VectorXd kTimes = Eigen::Vector2d(0.6, 4.0);

/// Columns of the basis of sizes 1 to 5000; the simulator moves by |K L| between 2 and 40, which the reaches
/// below take for much, little or nothing.
inline HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {22});
  data.basis = normal_matrix(kN, kQ, 41);
  data.basis.col(0) *= 5000.0;
  data.basis.col(2).setOnes();
  data.moves = data.basis * (Eigen::Vector3d(1e-3, 0.4, 2.0).asDiagonal() * normal_matrix(kQ, 2, 49));
  data.responses = 3.0 * normal_matrix(kN, 5, 42);
  data.responses.col(1).array() += 10.0;
  data.condition = {0, 0, 1, 2, 2};
  data.y =
      data.basis * Eigen::Vector3d(0.002, 1.0, 20.0) + 0.4 * data.responses.col(2) + normal_vector(kN, 43);
  return data;
}

inline HistoryPriors make_priors() {
  HistoryPriors priors;
  priors.noise_sd = kNoise;
  priors.noise_shape = 5.0;
  priors.amplitude = 1.4;
  priors.error = {kTimes, Eigen::Vector3d(0.0, 0.5, 3.0)};
  priors.reach = {0.5, 60.0, kInfinity};
  return priors;
}

inline HistoryModel make_model(const HistoryData& data = make_data()) {
  return HistoryModel(data, make_priors(), Context());
}

constexpr int kSettings = 27;  // nine errors for each of three reaches

inline const VectorXd kMean = Eigen::Vector3d(0.0015, 1.1, 19.0), kSpread = Eigen::Vector3d(1e-7, 0.4, 0.0);

/// Columns centred and scaled to unit population variance.
inline MatrixXd standardised(const HistoryData& data) {
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < phi.cols(); ++j) phi.col(j) *= std::sqrt(kN / phi.col(j).squaredNorm());
  return phi;
}

/// (I + (E E' / (kappa sigma_0^2))^2)^-1 phi, E = K L, with N x N matrices. Its condition is 1e8: in double
/// precision this side would be the less accurate one.
inline MatrixXd out_of_reach(const HistoryData& data, double reach, const MatrixXd& phi) {
  if (std::isinf(reach)) return phi;
  using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const LongMatrix moves = data.moves.cast<long double>();
  const LongMatrix a = moves * moves.transpose() / static_cast<long double>(reach * kNoise * kNoise);
  const LongMatrix inverted = LongMatrix::Identity(kN, kN) + a * a;
  return inverted.ldlt().solve(phi.cast<long double>()).cast<double>();
}

inline MatrixXd dense_psi(const HistoryData& data, int setting) {
  return out_of_reach(data, make_priors().reach[static_cast<std::size_t>(setting / 9)], standardised(data));
}

/// Variances t_s / p_s of the coefficients of the filter columns.
inline VectorXd prior_variances(const HistoryData& data, const VectorXd& t) {
  VectorXd variances(data.responses.cols());
  for (Index j = 0; j < variances.size(); ++j) {
    const int s = data.condition[static_cast<std::size_t>(j)];
    variances[j] = t[s] / static_cast<double>(std::count(data.condition.begin(), data.condition.end(), s));
  }
  return variances;
}

/// Of error and discrepancy.
inline MatrixXd dense_covariance(const HistoryData& data, const HistoryParameters& p) {
  const MatrixXd psi = dense_psi(data, p.setting);
  return p.variance * error_covariance(data.axis, kTimes, make_priors().error.setting(p.setting % 9)) +
         psi * prior_variances(data, p.t).asDiagonal() * psi.transpose();
}

/// log density of y for coefficients N(mean, covariance).
inline double dense_density(const HistoryData& data, const HistoryParameters& p, const VectorXd& mean,
                            const MatrixXd& covariance) {
  return log_normal_density(data.y, data.basis * mean,
                            dense_covariance(data, p) + data.basis * covariance * data.basis.transpose());
}

inline double dense_density(const HistoryData& data, const HistoryParameters& p) {
  return dense_density(data, p, kMean, kSpread.asDiagonal());
}

/// A covariance of coefficients that are far from independent.
inline GaussianSimulator make_simulator() {
  return {kMean, Eigen::Vector3d(3e-4, 0.6, 0.3).asDiagonal() * normal_matrix(kQ, 2, 48)};
}

/// The densities here lie between -40 and -200; 1e-8 is what rounding in covariances with eigenvalues from
/// 0.1 to 1e5 leaves of them.
constexpr double kRounding = 1e-8;

}  // namespace amiss::test
