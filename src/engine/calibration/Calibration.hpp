#pragma once
#include "engine/ais/Sampler.hpp"
#include "engine/calibration/CalibrationTarget.hpp"
#include "engine/calibration/Linearisation.hpp"

namespace amiss {

struct CalibrationOptions {
  AisOptions ais;
  int kept = 32;  ///< posterior draws, spread evenly, for which the discrepancy is worked out
};

/// The posterior of a model, given the record.
struct Calibration {
  AisResult posterior;                     ///< in the coordinates of CalibrationTarget
  std::vector<HistoryParameters> history;  ///< of each draw
  Eigen::MatrixXd unit;                    ///< draws x P: parameters in the unit cube
  std::vector<Eigen::Index> kept;          ///< draws of equal weight, spread over the posterior
  Eigen::MatrixXd coefficients;            ///< p x kept: posterior mean coefficients b of the filter columns
  /// r x kept: coefficients of what the reach takes out. The discrepancy of a kept draw is
  /// Psi b = Phi b - E withheld.
  Eigen::MatrixXd withheld;
  Eigen::VectorXd reach;      ///< posterior probability of each reach of the grid
  GaussianSimulator tangent;  ///< the simulator as the line that touches it at the posterior's centre
};

/// Samples the joint posterior. It is annealed from where error and discrepancy lie when the simulator is a
/// Gaussian (first over the priors, then about the mode that this leads to), times the modes of the
/// parameters there (ParameterModes), mixed defensively with the prior; then from the mixture to which those
/// draws lead (PopulationMonteCarlo).
AisResult sample_posterior(const CalibrationTarget& target, const AisOptions& options,
                           const Context& context);

/// The posterior with all conditions active, and what follows from it.
Calibration calibrate(const HistoryModel& model, const Emulator& emulator, const CalibrationOptions& options,
                      const Context& context);

/// Conditions 0 ... S-1 but those of `without`.
std::vector<int> conditions_but(const HistoryModel& model, const std::vector<int>& without);

}  // namespace amiss
