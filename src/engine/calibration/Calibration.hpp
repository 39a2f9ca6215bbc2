#pragma once
#include "engine/ais/Sampler.hpp"
#include "engine/calibration/CalibrationTarget.hpp"
#include "engine/calibration/Linearisation.hpp"

namespace amiss {

struct CalibrationOptions {
  AisOptions ais;
  int kept = 32;  ///< posterior draws, spread evenly, for which the discrepancy is worked out
};

/// What a calibration says of one of its records.
struct RecordPosterior {
  std::vector<HistoryParameters> history;  ///< of each draw
  Eigen::MatrixXd coefficients;            ///< p x kept: posterior mean coefficients b of the filter columns
  /// r x kept: coefficients of what the reach takes out. The discrepancy of a kept draw is
  /// Psi b = Phi b - E withheld.
  Eigen::MatrixXd withheld;
  Eigen::MatrixXd withheld_covariance;  ///< r^2 x kept: of each such column given its draw, r x r by columns
  Eigen::MatrixXd
      withheld_of_condition;  ///< r x S: what of it is due to each condition, in the mean over kept draws
  Eigen::VectorXd reach;      ///< posterior probability of each reach of the grid
  GaussianSimulator tangent;  ///< the simulator as the line that touches it at the posterior's centre
};

/// The posterior of a model, given its records.
struct Calibration {
  AisResult posterior;             ///< in the coordinates of CalibrationTarget
  Eigen::MatrixXd unit;            ///< draws x P: parameters in the unit cube
  std::vector<Eigen::Index> kept;  ///< draws of equal weight, spread over the posterior
  std::vector<RecordPosterior> records;
};

/// Samples the joint posterior. It is annealed from where error and discrepancy lie when the simulator is a
/// Gaussian (first over the priors, then about the mode that this leads to), times the modes of the
/// parameters there (ParameterModes), mixed defensively with the prior; then from the mixture to which those
/// draws lead (PopulationMonteCarlo).
AisResult sample_posterior(const CalibrationTarget& target, const AisOptions& options,
                           const Context& context);

/// The posterior, and what follows from it for each record.
Calibration calibrate(const std::vector<Record>& records, const CalibrationOptions& options,
                      const Context& context);

}  // namespace amiss
