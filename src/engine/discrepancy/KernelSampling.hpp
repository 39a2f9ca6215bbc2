#pragma once
#include "engine/ais/Sampler.hpp"
#include "engine/discrepancy/KernelModel.hpp"

namespace amiss {

struct KernelSamplingOptions {
  double tolerance = 0.01;      ///< of an approximate value, nats
  Eigen::Index coarsest = 120;  ///< time steps up to which the posterior is annealed from the prior, densely
  int thinning = 4;             ///< time steps of one stage over those of the stage before
  int certified = 32;           ///< draws at which the values are compared with certified ones

  void check() const;
};

struct KernelSample {
  AisResult posterior;               ///< in the coordinates of KernelTarget
  double correction = 0.0;           ///< of the log evidence, found at the certified draws and applied
  double largest_error = 0.0;        ///< of the certified draws' values, nats
  long direct = 0, by_skeleton = 0;  ///< likelihood values of the last stage
  long coarse = 0;                   ///< of the stages before it
};

/// Posterior (6) and its evidence, annealed through the record: first from the prior to the posterior of
/// every k-th time step, then, from a mixture fitted to its draws and brought closer to it
/// (PopulationMonteCarlo), to that of a finer record, and so on to the full one. Any path of distributions is
/// valid for annealed importance sampling, so that the evidence is that of the full record. Values come from
/// a skeleton of the kernel that serves where the coarser posterior's draws lie, from a low rank or the dense
/// factor elsewhere; a sample of the final draws is compared with certified values and the evidence corrected
/// by what they say.
///
/// Where `options` leave them open: 64 pilot chains, groups of 16, at least one move while only draws are
/// needed, 300 draws for the first round of the importance sample, 400 effective draws in the end. Its
/// weights can have a heavy tail, of which its standard error can know too little: bench/micro measures by
/// how much estimates of several seeds lie further apart than they state.
KernelSample sample_kernel(const KernelModel& model, const AisOptions& options,
                           const KernelSamplingOptions& sampling, const Context& context);

}  // namespace amiss
