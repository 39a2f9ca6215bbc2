#pragma once
#include <boost/math/special_functions/gamma.hpp>

#include "engine/linalg/double_policy.hpp"

namespace amiss {

/// log Gamma(x), x > 0. Threads may call it at the same time, which std::lgamma does not promise: it leaves
/// the sign in a global variable.
inline double log_gamma(double x) { return boost::math::lgamma(x, DoublePolicy()); }

}  // namespace amiss
