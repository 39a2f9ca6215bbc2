#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

struct AisOptions {
  int pilot_chains = 0;  ///< of the pilot that adapts ladder and proposals; 0: 16 per dimension, at least 256
  int groups = 8;        ///< independent groups of chains of the run that gives the estimate, at first
  int max_groups = 64;   ///< more are run, at most so many, until ...
  double precision = 0.1;  ///< ... the standard error of the log evidence has come down to this, in nats
  int chains = 0;          ///< in a group; 0: 3 per dimension, at least 32
  int sweeps = 0;          ///< least number of moves of every chain at every temperature; 0: 3
  int max_sweeps = 30;     ///< greatest; the pilot finds how many the likelihood needs to forget where it was
  double ess_drop = 0.7;   ///< the pilot's next temperature leaves this conditional effective size per chain
  bool gradient = true;    ///< Hamiltonian moves too, where the target has a gradient, or a conditional
  bool resample = true;    ///< resample a group when its effective size falls below half; false: plain AIS
  int importance_draws = 1000;  ///< of the second estimator, from a fitted mixture; 0 leaves it out
  int refit_draws =
      0;  ///< of its first round, which only serves to fit the mixture again; 0: importance_draws
  double effective_draws = 0.0;  ///< more are drawn until so many are effective, and the precision is reached
  int max_components = 3;        ///< of that mixture
  int max_temperatures = 400;

  void check() const;
  AisOptions for_dimension(Eigen::Index d) const;  ///< with chains and sweeps filled in
};

}  // namespace amiss
