#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/basis/Basis.hpp"
#include "engine/emulator/GaussianProcess.hpp"

namespace amiss {

/// What an emulator is made of; plain numbers, so that it can be stored and made again exactly.
struct EmulatorState {
  Eigen::MatrixXd inputs;        ///< M x P in the unit cube
  Eigen::MatrixXd coefficients;  ///< M x Q
  Eigen::MatrixXd parameters;    ///< Q rows of GaussianProcessParameters::pack()
};

/// Independent Gaussian processes, one for each basis coefficient.
class Emulator {
 public:
  explicit Emulator(const EmulatorState& state);

  /// Trains all Q processes; work is shared over the threads of the context. The prior of lambda_q is
  /// Gamma(a', b' / (k_q'k_q)), a' = a + M (N - Q) / 2, b' = b + discarded_ss / 2, with a = 2 and b =
  /// sqrt(machine epsilon) times the largest singular value.
  static Emulator train(const Eigen::MatrixXd& inputs, const Basis& basis, const EmulatorOptions& options,
                        const Context& context);

  /// Mean and variance (n x Q) of the coefficients at points (n x P).
  void predict(const Eigen::MatrixXd& points, Eigen::MatrixXd& mean, Eigen::MatrixXd& variance) const;
  /// Leave-one-out mean and variance (M x Q), in the coefficients' own scale.
  void leave_one_out(Eigen::MatrixXd& mean, Eigen::MatrixXd& variance) const;

  EmulatorState state() const;
  Eigen::Index n_inputs() const { return inputs_.cols(); }
  Eigen::Index n_outputs() const { return coefficients_.cols(); }
  int evaluations() const;  ///< of the joint density, while training

 private:
  Emulator(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& coefficients);

  Eigen::MatrixXd inputs_, coefficients_;
  Eigen::RowVectorXd centre_, scale_;
  std::vector<GaussianProcess> processes_;
};

}  // namespace amiss
