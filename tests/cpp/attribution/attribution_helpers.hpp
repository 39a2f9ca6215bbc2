#pragma once
#include <vector>

#include "engine/discrepancy/FilterBank.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "helpers.hpp"

/// Records of which the second of three conditions may drive the discrepancy, and their models.
namespace amiss::test {

constexpr Index kN = 120;

/// AR(1) series with coefficient 0.8.
inline VectorXd autocorrelated(Index n, unsigned seed) {
  VectorXd x = normal_vector(n, seed);
  for (Index i = 1; i < n; ++i) x[i] = 0.8 * x[i - 1] + 0.6 * x[i];
  return x;
}

inline HistoryData make_data(double effect, unsigned seed) {
  HistoryData data;
  data.axis = even_axis(kN);
  data.basis.resize(kN, 2);
  data.basis.col(0) = data.axis.time.array().sin();
  data.basis.col(1).setOnes();
  MatrixXd x(kN, 3);
  for (unsigned s = 0; s < 3; ++s) x.col(s) = autocorrelated(kN, 100 * seed + s);
  const FilterBank bank(x, {0, 1, 2}, Eigen::Vector2d(0.0, 4.0), data.axis);
  data.responses = bank.responses;
  data.condition = bank.condition;
  data.y = data.basis * Eigen::Vector2d(1.0, 20.0) + effect * bank.responses.col(1) +
           0.5 * normal_vector(kN, 100 * seed + 9);
  return data;
}

inline HistoryModel make_model(const HistoryData& data, const ErrorOptions& error = {},
                               const std::vector<double>& reach = {kInfinity}) {
  HistoryPriors priors;
  priors.noise_sd = 0.5;
  priors.error = error;
  priors.reach = reach;
  return HistoryModel(data, priors, Context());
}

/// w ~ N(mean, root root'): both coefficients uncertain, and together.
inline GaussianSimulator make_simulator() {
  return {Eigen::Vector2d(0.8, 20.5), (MatrixXd(2, 2) << 0.4, 0.0, 0.3, 1.0).finished()};
}

inline const ErrorOptions kTwoErrors{VectorXd::Constant(1, 3.0), Eigen::Vector2d(0.0, 2.0)};

inline const std::vector<double> kReaches{30.0, kInfinity};

}  // namespace amiss::test
