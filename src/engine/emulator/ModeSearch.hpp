#pragma once
#include "engine/emulator/GaussianProcess.hpp"

namespace amiss {

/// Where the search for the mode of the joint density (3) ended.
struct Mode {
  GaussianProcessParameters parameters;
  double value = 0.0;   ///< of the log density
  int evaluations = 0;  ///< of it
  std::vector<SelectionStep> selection;
  std::vector<int> beta_of;  ///< inputs of the same number share a beta
};

/// Mode of the joint density (3) of one coefficient.
///
/// Without forward selection every parameter has its own beta from the start. With it, as in Welch et al.
/// (1992, Screening, predicting, and computer experiments, Technometrics 34), all share one beta; at each
/// stage each parameter that still shares it is given its own in turn, the others keep sharing, and the one
/// whose mode is highest keeps it. The inert parameters are left with one beta, near 1 if they do nothing.
///
/// The stages are nested and a step frees one hyper-parameter inside its range, so that twice the gain of a
/// parameter that does not deserve it is chi-squared with one degree of freedom. The best of k is taken: it
/// must be significant at the level options.significance / k (Bonferroni), or the selection ends.
/// @throws std::runtime_error if the density is finite nowhere.
Mode find_mode(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values, const HyperPriors& priors,
               const SearchOptions& options);

/// Least gain of the log density that earns one of k candidates its own beta.
double selection_threshold(double significance, int k);

}  // namespace amiss
