#pragma once
#include <functional>
#include <limits>
#include <vector>

#include "engine/Context.hpp"
#include "engine/basis/Basis.hpp"
#include "engine/emulator/GaussianProcess.hpp"
#include "engine/emulator/Region.hpp"

namespace amiss {

/// What an emulator is made of; plain numbers, so that it can be stored and made again exactly.
struct EmulatorState {
  Eigen::MatrixXd inputs;        ///< M x P, of the region, in the unit cube
  Eigen::MatrixXd coefficients;  ///< M x Q
  Eigen::MatrixXd parameters;    ///< Q rows of GaussianProcessParameters::pack()
  Region region;                 ///< where it holds
  /// Q x (P + 1): mean of each coefficient, its value at an input of zero and its slopes, which the processes
  /// add to; empty for none.
  Eigen::MatrixXd trend;
};

struct EmulatorOptions {
  SearchOptions search;
  /// Priors of every process. Those of lambda are a and b of the joint density (3), b in the squared unit of
  /// the outputs; NaN stands for sqrt(machine epsilon) times the squared largest singular value d.
  /// Where the basis leaves nothing out, the noise has then an RMS of 1.7e-4 of the runs' at each output
  /// (1 / lambda = 3e-8 d^2 / (M (N - Q)), the runs' mean square d^2 / (M N)) and of 1.7e-4 / sqrt(N) of the
  /// leading coefficient's: 1e-5 for N = 300, as the jitter of its covariance has, far above rounding and far
  /// below what a basis is cut off at.
  HyperPriors priors{{2.0, std::numeric_limits<double>::quiet_NaN()}, {}, {}, {}};
};

/// Independent Gaussian processes, one for each basis coefficient.
class Emulator {
 public:
  explicit Emulator(const EmulatorState& state);

  /// Trains all Q processes; work is shared over the threads of the context. The prior of lambda_q is
  /// Gamma(a', b' / (k_q'k_q)), a' = a + M (N - Q) / 2, b' = b + discarded_ss / 2. The variances of
  /// each process are widened to its leave-one-out errors, of hyper-parameters that have not seen the run
  /// left out (GaussianProcess::widen()).
  /// @param trend  as in EmulatorState, or empty. A simulator's tangent is one: the processes are left with
  /// what
  ///   bends, so that a handful of runs do.
  static Emulator train(const Eigen::MatrixXd& inputs, const Basis& basis, const EmulatorOptions& options,
                        const Context& context, const Eigen::MatrixXd& trend = {});

  /// Mean and variance (n x Q) of the coefficients of runs at inputs (n x P): those that the projection of
  /// such a run on the basis has. They vary about the smooth part of the process by the nugget and 1 /
  /// lambda, as those of the training runs do, so that both are in the variance.
  void predict(const Eigen::MatrixXd& inputs, Eigen::MatrixXd& mean, Eigen::MatrixXd& variance) const;
  /// The same at points (P x n) in the coordinates N(0, I) of the parameters, for a calibration. In a region
  /// the variance is its median there: where it grows towards the end, a posterior would find the record
  /// likely for no other reason than that nothing is known. Outside the region an emulator knows nothing, and
  /// does not say so here: ask region().contains().
  void predict_at(const Eigen::MatrixXd& points, Eigen::MatrixXd& mean, Eigen::MatrixXd& variance) const;
  /// Gradient (P x n), at n such points, of a function of the mean coefficients there, whose gradient with
  /// respect to these (n x Q, as they are given) is by_mean.
  using ByMean = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& mean)>;
  Eigen::MatrixXd slopes_at(const Eigen::MatrixXd& points, const ByMean& by_mean) const;
  /// The median of each coefficient's variance, over the region or, everywhere, over the prior.
  const Eigen::RowVectorXd& typical_variance() const { return typical_variance_; }
  /// Leave-one-out mean and variance (M x Q), widened, by hyper-parameters that have not seen the run left
  /// out, in the coefficients' own scale. @throws std::logic_error if made of a state, not trained.
  void leave_one_out(Eigen::MatrixXd& mean, Eigen::MatrixXd& variance) const;

  EmulatorState state() const;
  const Region& region() const { return region_; }
  Eigen::Index n_inputs() const { return inputs_.cols(); }
  Eigen::Index n_outputs() const { return coefficients_.cols(); }
  int evaluations() const;          ///< of the joint density, while training
  Eigen::VectorXd widened() const;  ///< factor of the variances of each process, if trained
  /// Of the forward selection while training, one for each coefficient.
  std::vector<std::vector<SelectionStep>> selections() const;

 private:
  Emulator(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& coefficients, const Eigen::MatrixXd& trend);
  Eigen::MatrixXd trend_at(const Eigen::MatrixXd& inputs) const;  // n x Q

  Eigen::MatrixXd inputs_, coefficients_, trend_;
  Eigen::MatrixXd bends_;  // coefficients less the trend
  Eigen::RowVectorXd centre_, scale_;
  Region region_;
  Eigen::RowVectorXd typical_variance_;  // of an emulator made of its state
  std::vector<GaussianProcess> processes_;
};

}  // namespace amiss
