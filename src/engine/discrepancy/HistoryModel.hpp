#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/ais/Target.hpp"
#include "engine/error/ErrorModel.hpp"

namespace amiss {

/// The data of a history model.
struct HistoryData {
  Eigen::VectorXd y;           ///< N: the measured target
  Eigen::MatrixXd basis;       ///< N x Q: basis K of the simulation space
  Eigen::MatrixXd responses;   ///< N x p: filter bank Phi; every column is centred and scaled here
  std::vector<int> condition;  ///< p: boundary condition of each column, 0 ... S-1
  TimeAxis axis;

  int conditions() const;
  void check() const;
};

/// Priors of the history model.
struct HistoryPriors {
  double noise_sd = 1.0;     ///< stated standard deviation of the white noise
  double noise_shape = 2.0;  ///< shape a* = N c of lambda* ~ Gamma(a*, a* noise_sd^2): confidence in noise_sd
  double inclusion = 0.2;    ///< probability that a condition drives the discrepancy at all; else t_s = 0
  double amplitude = 1.0;    ///< scale of the half-Cauchy prior of sqrt(t_s), if it does
  ErrorOptions error;        ///< grid of error settings, all equally probable before the data

  void check() const;
};

/// One error setting: everything that a likelihood needs, worked out once in a pass linear in N. With the
/// whitener W of the setting, W K = O R (O orthonormal columns) and P = I - O O':
struct WhitenedData {
  Eigen::MatrixXd gram;                 ///< Phi' W' P W Phi, p x p
  Eigen::VectorXd cross;                ///< Phi' W' P W y, p
  double square = 0.0;                  ///< y' W' P W y
  double log_det = 0.0;                 ///< -1/2 log|H'CH|, C = (W'W)^-1, H the complement of K
  Eigen::MatrixXd root;                 ///< R, Q x Q upper triangular
  Eigen::VectorXd estimate;             ///< R^-1 O' W y: generalised least squares coefficients of y on K
  Eigen::Index residual_dimension = 0;  ///< N - Q
};

WhitenedData whiten(const HistoryData& data, const Eigen::VectorXd& correlation_times,
                    const Eigen::VectorXd& ratios);

/// 1/2 log|K'K|, whatever the sizes of the columns.
double log_volume(const Eigen::MatrixXd& basis);

/// Discrepancy driven by the history of the boundary conditions,
///     v ~ N(0, sum_s t_s Phi_s Phi_s' / p_s),  p_s columns of condition s,
/// seen with an error of ErrorModel's kind, in the complement of the simulation space under the metric of
/// that error. In whitened coordinates this is the paper's split: the part of y inside the simulation space,
/// the generalised least squares coefficients, is independent of the part outside.
///
/// What lies outside is seen through H'y, H the orthonormal complement of K, which no error setting and no w
/// changes: with C the covariance of the error for sigma = 1, H~ the complement of W K,
///     H'y ~ N(0, H'(sigma^2 C + Phi D Phi')H),  H~'W y = A H'y,
///     |A| = |H'CH|^(-1/2) = |W| |K'K|^(1/2) / |R|.
/// The density of H'y times |K'K|^(-1/2) times that of the coefficients is the density of y. |A| must stand
/// here: |W| alone would compare error settings by densities of different statistics.
class HistoryModel {
 public:
  HistoryModel(HistoryData data, HistoryPriors priors, const Context& context);

  /// log density of H'y, the part of y outside the simulation space, given the error setting, log sigma^2 and
  /// the t_s of the conditions (t_s = 0 leaves one out). The gradient is with respect to (log sigma^2, log
  /// t_1
  /// ... log t_S).
  double log_likelihood(int setting, double log_variance, const Eigen::VectorXd& t,
                        Eigen::VectorXd* gradient = nullptr) const;
  double log_likelihood(const WhitenedData& whitened, double log_variance, const Eigen::VectorXd& t,
                        Eigen::VectorXd* gradient = nullptr) const;

  /// Posterior mean of the coefficients of the (scaled) filter columns.
  Eigen::VectorXd coefficients(const WhitenedData& whitened, double log_variance,
                               const Eigen::VectorXd& t) const;

  /// Share of y outside the simulation space that the conditions with t_s > 0 explain, in the metric of the
  /// error:
  ///     1 - sigma^2 v'(H'AH)^-1 v / v'(H'CH)^-1 v,  v = H'y,  A = sigma^2 C + sum_s t_s Phi_s Phi_s' / p_s.
  /// The numerator is the response fitted by the conditions times v, so that for white error this is
  /// cov(response, y) / var(y). Between 0 and 1; never less for more conditions.
  double explained(const WhitenedData& whitened, double log_variance, const Eigen::VectorXd& t) const;

  const HistoryData& data() const { return data_; }
  const HistoryPriors& priors() const { return priors_; }
  const WhitenedData& whitened(int setting) const { return settings_[setting]; }
  int settings() const { return static_cast<int>(settings_.size()); }
  int conditions() const { return conditions_; }
  const Eigen::VectorXd& columns_per_condition() const { return columns_; }
  const Eigen::RowVectorXd& centre() const { return centre_; }  ///< subtracted from each filter column
  const Eigen::RowVectorXd& scale() const { return scale_; }    ///< then divided by this

 private:
  struct Factor;
  Factor factorise(const WhitenedData& whitened, double precision, const Eigen::VectorXd& t) const;

  HistoryData data_;
  HistoryPriors priors_;
  int conditions_;
  Eigen::VectorXd columns_;
  Eigen::RowVectorXd centre_, scale_;
  std::vector<WhitenedData> settings_;
};

/// A point of the history posterior in natural terms.
struct HistoryParameters {
  int setting = 0;        ///< index of the error setting
  double variance = 1.0;  ///< sigma^2
  Eigen::VectorXd t;      ///< S; 0 where a condition is left out
};

/// Posterior of the history model with some of its conditions active. Coordinates: sigma, one per error
/// component, one per active condition, these in an order that hangs on their columns alone: conditions that
/// are numbered otherwise are sampled by the same chains.
class HistoryTarget : public Target {
 public:
  HistoryTarget(const HistoryModel& model, std::vector<int> active);

  Eigen::Index dimension() const override;
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  /// The coordinates of the error's grid have gradient zero: the likelihood is constant between its jumps.
  bool has_gradient() const override { return true; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const override;
  HistoryParameters parameters(const Eigen::VectorXd& x) const;
  const HistoryModel& model() const { return model_; }
  const std::vector<int>& active() const { return active_; }  ///< condition of each of the last coordinates

 private:
  const HistoryModel& model_;
  std::vector<int> active_;
};

}  // namespace amiss
