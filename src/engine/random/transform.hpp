#pragma once
#include <cmath>

namespace amiss {

/// Standard normal distribution function; maps the sampler's coordinates onto the unit interval.
inline double normal_cdf(double x) { return 0.5 * std::erfc(-x * 0.70710678118654752440); }
/// Its density.
inline double normal_density(double x) { return 0.39894228040143267794 * std::exp(-0.5 * x * x); }

}  // namespace amiss
