#pragma once
#include <vector>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// When each value was taken. A new segment starts wherever the record is broken: nothing is carried across.
struct TimeAxis {
  Eigen::VectorXd time;           ///< N, increasing within a segment; any unit, here hours
  std::vector<bool> new_segment;  ///< N; the first is always true

  Eigen::Index size() const { return time.size(); }
  void check() const;
};

/// The error of measurement and model that is tied to no boundary condition:
///     e(t) = sigma [ white + sum_k OU_k(t) ],   cov OU_k(t, t') = ratio_k exp(-|t - t'| /
///     correlation_time_k).
/// Few settings of the ratios serve (a grid): all that a likelihood needs is worked out once for each.
struct ErrorOptions {
  Eigen::VectorXd correlation_times;  ///< K > 0 each, in the unit of TimeAxis
  Eigen::VectorXd ratios;             ///< grid of each ratio_k, >= 0; K = 0 means white error

  int settings() const;                  ///< number of grid points, (number of ratios)^K
  Eigen::VectorXd setting(int g) const;  ///< ratio_k of grid point g, K values
  void check() const;
};

/// The innovations filter of such an error with sigma = 1: a linear map W with W cov(e) W' = I, computed by
/// the Kalman recursion in one pass, linear in N (Durbin and Koopman 2012, section 4.3).
class Whitener {
 public:
  Whitener(const TimeAxis& axis, const Eigen::VectorXd& correlation_times, const Eigen::VectorXd& ratios);

  /// W x for every column of x (N rows).
  Eigen::MatrixXd operator()(const Eigen::Ref<const Eigen::MatrixXd>& x) const;
  /// The same for rows first ... first + n - 1 alone, given and leaving behind the state of the filter
  /// (columns x K, of any size at the first row): a long record in blocks.
  Eigen::MatrixXd rows(const Eigen::Ref<const Eigen::MatrixXd>& x, Eigen::Index first,
                       Eigen::MatrixXd& state) const;
  double log_det() const { return log_det_; }  ///< log |W|

 private:
  Eigen::MatrixXd decay_;  // K x N: exp(-dt / correlation_time) from the value before, 0 at a segment's first
  Eigen::MatrixXd gain_;   // K x N
  Eigen::VectorXd scale_;  // N: 1 / sd of the innovation
  double log_det_ = 0.0;
};

}  // namespace amiss
