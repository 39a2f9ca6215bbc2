#pragma once
#include <cmath>

#include "engine/calibration/CalibrationTarget.hpp"
#include "helpers.hpp"

/// A record, a model of it and an emulator for the tests of the calibration.
namespace amiss::test {

constexpr Index kN = 30;
constexpr double kNoise = 0.9;

/// Two coefficients of very different size, smooth in the parameters; hyper-parameters as given.
inline Emulator make_emulator(Index n_inputs, double log_nugget = -5.0) {
  EmulatorState state;
  state.inputs = uniform_matrix(15, n_inputs, 81);
  state.coefficients.resize(15, 2);
  for (Index m = 0; m < 15; ++m) {
    state.coefficients(m, 0) = 0.02 * std::sin(2.0 * state.inputs(m, 0));
    state.coefficients(m, 1) = 20.0 + 3.0 * state.inputs.row(m).sum();
  }
  state.parameters = MatrixXd::Constant(2, n_inputs + 3, 1.5);
  state.parameters.col(0).setConstant(1.0);
  state.parameters.col(1).setConstant(log_nugget);
  state.parameters.col(2).setConstant(6.0);
  return Emulator(state);
}

inline HistoryData make_data() {
  HistoryData data;
  data.axis = uneven_axis(kN, {14});
  data.basis.resize(kN, 2);
  data.basis.col(0) = 60.0 * normal_vector(kN, 82);
  data.basis.col(1).setOnes();
  data.moves = data.basis * Eigen::Vector2d(0.006, 0.9).asDiagonal();
  data.responses = normal_matrix(kN, 3, 83);
  data.condition = {0, 0, 1};
  data.y = data.basis * Eigen::Vector2d(0.015, 21.4) + normal_vector(kN, 84);
  return data;
}

inline HistoryPriors make_priors(const ErrorOptions& error) {
  HistoryPriors priors;
  priors.noise_sd = kNoise;
  priors.error = error;
  return priors;
}

inline HistoryModel make_model(const ErrorOptions& error, const HistoryData& data = make_data()) {
  return HistoryModel(data, make_priors(error), Context());
}

inline const ErrorOptions kError{VectorXd::Constant(1, 2.0), Eigen::Vector2d(0.0, 3.0)};

inline void predict(const Emulator& emulator, const VectorXd& u, VectorXd& mean, VectorXd& variance) {
  MatrixXd m, v;
  emulator.predict(u.transpose(), m, v);
  mean = m.row(0);
  variance = v.row(0);
}

/// The responses, centred and scaled to the prior standard deviations of their coefficients.
inline MatrixXd scaled_responses(const HistoryData& data, const VectorXd& t) {
  MatrixXd phi = data.responses.rowwise() - data.responses.colwise().mean();
  for (Index j = 0; j < 3; ++j)
    phi.col(j) *= std::sqrt(t[data.condition[static_cast<std::size_t>(j)]] / (j < 2 ? 2.0 : 1.0) * kN /
                            phi.col(j).squaredNorm());
  return phi;
}

/// An emulator of two parameters, and the record under a reach of 20 or none.
struct Joint {
  Emulator emulator = make_emulator(2);
  HistoryModel model;
  explicit Joint(const HistoryData& data = make_data())
      : model([&] {
          HistoryPriors priors = make_priors(kError);
          priors.reach = {20.0, kInfinity};
          return HistoryModel(data, priors, Context());
        }()) {}
  CalibrationTarget target() const { return {model, {0, 1}, emulator}; }
};

}  // namespace amiss::test
