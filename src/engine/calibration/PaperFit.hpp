#pragma once
#include "engine/calibration/PaperCalibration.hpp"
#include "engine/discrepancy/KernelSampling.hpp"

namespace amiss {

struct PaperOptions {
  AisOptions ais;
  double tolerance = 0.01;     ///< of the values of (6), nats; 0 for dense ones, annealed from the prior
  bool shared_lambda = false;  ///< one noise precision for all basis vectors
};

/// Both posteriors of the paper.
struct PaperFit {
  KernelSample outside;                 ///< posterior (6)
  std::vector<KernelParameters> draws;  ///< its draws
  AisResult inside;                     ///< posterior (5)
  Eigen::MatrixXd unit;                 ///< its draws x P: parameters in the unit cube
  Eigen::MatrixXd lambda;               ///< draws x (Q or 1): noise precisions
  double log_jacobian = 0.0;            ///< -1/2 log|K'K|, in the evidence of (5)
};

/// Posterior (6) of the discrepancy, and posterior (5) of the parameters, each on its own part of the record.
PaperFit calibrate_paper(const KernelModel& model, const PaperCalibration& coefficients,
                         const Emulator& emulator, const PaperOptions& options, const Context& context);

}  // namespace amiss
