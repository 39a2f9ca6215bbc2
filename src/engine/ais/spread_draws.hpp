#pragma once
#include <vector>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// n draws of equal weight, evenly spread over weighted ones (weights of sum 1): their numbers, rising.
std::vector<Eigen::Index> spread_draws(const Eigen::VectorXd& weights, int n);

}  // namespace amiss
