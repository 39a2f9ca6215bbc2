#pragma once
#include "engine/ais/AisOptions.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"

namespace amiss {

/// What the record says if the simulator is the straight line that touches it at x0, in the coordinates
/// N(0, I) of its parameters.
struct TangentPosterior {
  Eigen::VectorXd mean;                    ///< P: of the parameters
  Eigen::MatrixXd covariance;              ///< P x P
  std::vector<HistoryParameters> history;  ///< draws of equal weight of error and discrepancy
};

/// With f0 the run at x0 and J its slopes, y - f0 + J x0 = J x + discrepancy + error, x ~ N(0, I): closed in
/// the parameters, so that only error and discrepancy are sampled. One step of a Gauss-Newton search, with
/// the covariance of the record as uncertain as it is.
/// @param data    of the record, y included; its basis is not used.
/// @param slopes  J, N x P.
/// @param draws   of error and discrepancy.
TangentPosterior tangent_posterior(HistoryData data, const HistoryPriors& priors, const Eigen::VectorXd& x0,
                                   const Eigen::VectorXd& run, const Eigen::MatrixXd& slopes, int draws,
                                   const AisOptions& options, const Context& context);

/// The top of a parabola and the inverse of its curvature.
struct TangentOptimum {
  Eigen::VectorXd mean;        ///< P: of the parameters
  Eigen::MatrixXd covariance;  ///< P x P
};

/// With points (V_k) of error and discrepancy that are known: where a Gauss-Newton step leads from x0 on
///     l(x) = log mean_k N(y; f(x), V_k) + log N(x; 0, I),
///     grad l = sum_k w_k [J' V_k^-1 (y - f0)] - x0,  w_k = N(y; f0, V_k) / sum of them,
/// its curvature I + sum_k w_k J' V_k^-1 J. A short step on that way raises l.
TangentOptimum tangent_given(HistoryData data, const HistoryPriors& priors,
                             const std::vector<HistoryParameters>& history, const Eigen::VectorXd& x0,
                             const Eigen::VectorXd& run, const Eigen::MatrixXd& slopes,
                             const Context& context);

}  // namespace amiss
