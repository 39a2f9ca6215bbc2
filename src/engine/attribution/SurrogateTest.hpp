#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"

namespace amiss {

struct SurrogateOptions {
  int surrogates = 199;          ///< number of shifted copies of the boundary conditions
  double smallest_shift = 0.05;  ///< of the record; nearer copies are too much like the original
  std::vector<int> settings;     ///< settings of error and reach among which the fit may choose
  int max_evaluations = 80;      ///< of the likelihood, per fit

  void check() const;
};

/// Does the discrepancy answer to a set of conditions, or would any series with the same autocorrelation do
/// as well?
struct SurrogateTest {
  Eigen::VectorXd
      statistic;            ///< of each set: log-likelihood lost when it is dropped and the rest fitted again
  Eigen::VectorXd p_value;  ///< (1 + surrogates that lose as much) / (1 + surrogates)
  Eigen::VectorXd adjusted;         ///< the same for all sets together (adjusted_p_values())
  Eigen::MatrixXd null_statistics;  ///< surrogates x sets
};

/// Null distribution from circular shifts of all conditions together: each keeps its autocorrelation, and all
/// keep their correlation with one another. The same fits are made for the data and for each surrogate, with
/// the simulator as a Gaussian.
/// @param sets  of conditions that are dropped together.
SurrogateTest surrogate_test(const HistoryModel& model, const GaussianSimulator& simulator,
                             const std::vector<std::vector<int>>& sets, const SurrogateOptions& options,
                             const Context& context);

/// Step-down p-values of Westfall and Young (1993) for several statistics together: that of the k-th largest
/// is the share of surrogates in which any of those not larger comes as high. Statistics are compared in
/// units of the 95 % quantiles of their null distributions (at least `least`), so that none sets the measure
/// for the others. Unlike Holm's, the least p-value does not grow with the number of statistics: 1 / (1 +
/// surrogates).
Eigen::VectorXd adjusted_p_values(const Eigen::VectorXd& statistic, const Eigen::MatrixXd& null_statistics,
                                  double least = 0.5);

/// The setting of highest likelihood when no condition drives the discrepancy.
int null_setting(const HistoryModel& model, const GaussianSimulator& simulator);

}  // namespace amiss
