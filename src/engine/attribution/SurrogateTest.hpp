#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/HistoryModel.hpp"

namespace amiss {

struct SurrogateOptions {
  int surrogates = 199;             ///< number of shifted copies of the boundary conditions
  double smallest_shift = 0.05;     ///< of the record; nearer copies are too much like the original
  std::vector<int> error_settings;  ///< error settings among which the fit may choose
  int max_evaluations = 80;         ///< of the likelihood, per fit

  void check() const;
};

/// Does the discrepancy answer to a condition, or would any series with the same autocorrelation do as well?
struct SurrogateTest {
  Eigen::VectorXd
      statistic;             ///< S: log-likelihood lost when condition s is dropped and the rest fitted again
  Eigen::VectorXd p_value;   ///< S: (1 + surrogates that lose as much) / (1 + surrogates)
  Eigen::VectorXd adjusted;  ///< S: the same after Holm (1979), for all conditions together
  Eigen::MatrixXd null_statistics;  ///< surrogates x S
};

/// Null distribution from circular shifts of all conditions together: each keeps its autocorrelation, and all
/// keep their correlation with one another. The same fits are made for the data and for each surrogate.
SurrogateTest surrogate_test(const HistoryModel& model, const SurrogateOptions& options,
                             const Context& context);

/// Holm's step-down adjustment of p-values.
Eigen::VectorXd holm(const Eigen::VectorXd& p_values);

/// The error setting of highest likelihood when no condition drives the discrepancy.
int null_setting(const HistoryModel& model);

}  // namespace amiss
