#pragma once
#include <algorithm>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Lexicographic order of vectors of equal length: an order by content, whatever they are called.
inline bool precedes(const Eigen::Ref<const Eigen::VectorXd>& a, const Eigen::Ref<const Eigen::VectorXd>& b) {
  return std::lexicographical_compare(a.data(), a.data() + a.size(), b.data(), b.data() + b.size());
}

}  // namespace amiss
