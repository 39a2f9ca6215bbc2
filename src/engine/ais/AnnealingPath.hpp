#pragma once
#include "engine/ais/Distribution.hpp"
#include "engine/ais/Target.hpp"

namespace amiss {

/// The way from a reference distribution r to a posterior, prior p times likelihood L, at inverse
/// temperatures from 0 to 1:
///     r(x)^(1 - beta) [p(x) L(x)]^beta = r(x) exp(beta rise(x)),  rise = log p + log L - log r.
/// From the prior itself the rise is the log-likelihood.
struct AnnealingPath {
  const Target& target;
  const Distribution& reference;
};

}  // namespace amiss
