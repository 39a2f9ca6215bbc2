#pragma once
#include <limits>
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/CoefficientLikelihood.hpp"
#include "engine/error/ErrorModel.hpp"

namespace amiss {

/// The data of a history model.
struct HistoryData {
  Eigen::VectorXd y;           ///< N: the measured target
  Eigen::MatrixXd basis;       ///< N x Q: basis K of the simulation space
  Eigen::MatrixXd responses;   ///< N x p: filter bank Phi; every column is centred and scaled here
  std::vector<int> condition;  ///< p: boundary condition of each column, 0 ... S-1
  TimeAxis axis;
  /// N x r: root E of the covariance E E' that the simulator's output has under the priors of its parameters:
  /// how far it can move. Only the reach of the discrepancy needs it.
  Eigen::MatrixXd moves;

  int conditions() const;
  void check(double noise_sd) const;
};

/// Priors of the history model.
struct HistoryPriors {
  double noise_sd = 1.0;            ///< stated standard deviation of the white noise
  double noise_shape = 2.0;         ///< a* = N c of sigma^2 ~ noise_sd^2 F(2a*, 2a*): confidence in noise_sd
  double discarded_variance = 0.0;  ///< of what the basis leaves out of a run, added to the white noise
  double inclusion = 0.2;  ///< probability that a condition drives the discrepancy at all; else t_s = 0
  double amplitude = 1.0;  ///< scale of the half-Cauchy prior of sqrt(t_s), if it does
  ErrorOptions error;      ///< grid of error settings, all equally probable before the data
  /// Grid of the discrepancy's reach kappa > 0, equally probable before the data; infinity: free.
  std::vector<double> reach{std::numeric_limits<double>::infinity()};

  void check() const;
};

/// One setting of error and reach: everything that a likelihood needs, worked out in a pass linear in N. With
/// the whitener W of the error, B = [K, Psi], r0 = y - K w0:
struct WhitenedData {
  Eigen::MatrixXd gram;           ///< B' W' W B, (Q + p) x (Q + p)
  Eigen::VectorXd cross;          ///< B' W' W r0, Q + p
  double square = 0.0;            ///< r0' W' W r0
  double log_det = 0.0;           ///< log |W|
  Eigen::Index size = 0;          ///< N
  Eigen::Index coefficients = 0;  ///< Q

  /// The same with the coefficients written as w = w0 + shift + root a: K becomes K root, r0 becomes
  /// r0 - K shift.
  WhitenedData in_terms_of(const Eigen::VectorXd& shift, const Eigen::MatrixXd& root) const;
};

/// A point of the history posterior in natural terms.
struct HistoryParameters {
  int setting = 0;        ///< index of the setting of error and reach
  double variance = 1.0;  ///< sigma^2
  Eigen::VectorXd t;      ///< S; 0 where a condition is left out
};

/// The measured record in one covariance:
///     y | w ~ N(K w, sigma^2 C + sum_s (t_s / p_s) Psi_s Psi_s'),   w ~ N(m, S) of a simulator or its
///     emulator,
/// C the covariance of an error of ErrorModel's kind, Psi_s the p_s filtered responses to condition s.
/// Nothing is split off: the discrepancy lives in all directions, those of the simulator included, and how
/// far it reaches into them is learned: with the covariance E E' of the runs,
///     Psi = (I + (E E' / (kappa sigma_0^2))^2)^-1 Phi,   sigma_0 the stated noise,
/// which takes out of Phi the directions in which the simulator moves by more than sqrt(kappa) sigma_0 (a sum
/// over the record), leaves those in which it moves less, and is Phi itself for kappa = infinity. The square
/// keeps weak directions out of it, so that how many vectors the basis has does not matter. The density is
/// one of y as it stands: no basis is preferred, and its size is only a matter of accuracy.
///
/// A value costs a Cholesky factor of the size Q + (columns of the conditions with t_s > 0), whatever N: with
/// r = y - K m, D = diag(S, t_s / p_s) and F = I + D^1/2 B'W'W B D^1/2 / sigma^2,
///     log|.| = N log sigma^2 - 2 log|W| + log|F|,
///     quadratic form = (r'W'W r - b' F^-1 b / sigma^2) / sigma^2,   b = D^1/2 B'W'W r.
class HistoryModel {
 public:
  /// @param only  settings that will be asked for; all if empty.
  HistoryModel(HistoryData data, HistoryPriors priors, const Context& context,
               const std::vector<int>& only = {});

  /// log density of y given the setting, log sigma^2, the t_s of the conditions (t_s = 0 leaves one out), and
  /// coefficients of the given mean and variances (Q each). The gradient is with respect to (log sigma^2,
  /// log t_1 ... log t_S).
  double log_likelihood(const HistoryParameters& point, const Eigen::VectorXd& mean,
                        const Eigen::VectorXd& variance) const;
  /// The same for coefficients that are standard normal in the terms of `whitened`.
  double log_likelihood(const WhitenedData& whitened, double log_variance, const Eigen::VectorXd& t,
                        Eigen::VectorXd* gradient = nullptr) const;

  /// The same as a function of the coefficients, for one point: cheap where many are asked for.
  CoefficientLikelihood given(const HistoryParameters& point) const;

  /// Posterior mean (p) of the coefficients of the filter columns Psi, and a root of their covariance
  /// (p x columns that act).
  struct Coefficients {
    Eigen::VectorXd mean;
    Eigen::MatrixXd root;
  };
  Coefficients coefficients(const HistoryParameters& point, const Eigen::VectorXd& mean,
                            const Eigen::VectorXd& variance) const;

  /// (y - K m)' (cov y)^-1 (y - K m) for coefficients that are standard normal in the terms of `whitened`.
  double quadratic(const WhitenedData& whitened, double log_variance, const Eigen::VectorXd& t) const;

  /// log density of y for each run of the simulator itself (columns of `runs`, N x n) at each of its points.
  /// All runs have equally many, one run's after the other's. Their variance holds no discarded part.
  Eigen::VectorXd log_likelihood_of_runs(const std::vector<HistoryParameters>& points,
                                         const Eigen::MatrixXd& runs, const Context& context) const;

  /// The setting's Gram matrices for other responses (N x p) in place of the model's.
  WhitenedData whiten(int setting, const Eigen::MatrixXd& responses) const;

  /// X (r x p) with Psi = Phi - E X: what the reach of a setting takes out of the responses.
  Eigen::MatrixXd withheld(int setting) const;

  const HistoryData& data() const { return data_; }
  const HistoryPriors& priors() const { return priors_; }
  const WhitenedData& whitened(int setting) const { return settings_[static_cast<std::size_t>(setting)]; }
  int settings() const { return static_cast<int>(settings_.size()); }
  int error_settings() const { return priors_.error.settings(); }
  int error_of(int setting) const { return setting % error_settings(); }
  double reach_of(int setting) const {
    return priors_.reach[static_cast<std::size_t>(setting / error_settings())];
  }
  int conditions() const { return conditions_; }
  const Eigen::VectorXd& reference() const { return reference_; }  ///< w0: least squares of y on K
  const Eigen::VectorXd& columns_per_condition() const { return columns_; }
  const Eigen::RowVectorXd& centre() const { return centre_; }  ///< subtracted from each filter column
  const Eigen::RowVectorXd& scale() const { return scale_; }    ///< then divided by this

 private:
  struct Factor;
  struct FreeGram;
  Factor factorise(const WhitenedData& whitened, double precision, const Eigen::VectorXd& t,
                   const Eigen::VectorXd& root, const Eigen::VectorXd& cross) const;
  Eigen::VectorXd shifted_cross(const WhitenedData& whitened, const Eigen::VectorXd& shift,
                                double& square) const;
  FreeGram whiten_freely(int error, const Eigen::MatrixXd& responses) const;
  void find_directions();
  Eigen::MatrixXd along_directions(double reach, const Eigen::MatrixXd& responses) const;

  HistoryData data_;
  HistoryPriors priors_;
  int conditions_;
  Eigen::VectorXd columns_, norms_, reference_, residual_;
  Eigen::RowVectorXd centre_, scale_;
  Eigen::MatrixXd directions_;          // N x r': left singular vectors of E, those that the reach acts upon
  Eigen::MatrixXd of_moves_;            // r x r': they are E of_moves_
  Eigen::ArrayXd energy_;               // r': squared singular values
  std::vector<WhitenedData> settings_;  // reach by reach, and for each error by error
};

}  // namespace amiss
