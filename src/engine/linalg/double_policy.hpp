#pragma once

#include <boost/math/policies/policy.hpp>

namespace amiss {

/// Special functions in double throughout: Boost's default goes through long double, at several times the
/// cost.
using DoublePolicy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

}  // namespace amiss
