#pragma once

namespace amiss {

/// What happened at one temperature of the ladder.
struct Temperature {
  double beta = 0.0;        ///< inverse temperature, in (0, 1]
  double step = 0.0;        ///< length of the moves
  int sweeps = 0;           ///< moves of every chain
  double acceptance = 0.0;  ///< of the frozen run
  double ess = 0.0;         ///< effective share of the chains after reweighting, mean over groups
};

}  // namespace amiss
