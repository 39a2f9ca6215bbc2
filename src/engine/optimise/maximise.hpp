#pragma once
#include <functional>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// A function to maximise: returns f(x) and, if `gradient` is not empty, fills it. A value that is not finite
/// means "not here"; the search backs off.
using Objective = std::function<double(const Eigen::VectorXd& x, Eigen::Ref<Eigen::VectorXd> gradient)>;

struct Maximum {
  Eigen::VectorXd x;  ///< the best point seen
  double value = 0.0;
  int evaluations = 0;
  bool converged = false;  ///< false if the limit on evaluations ended the search
};

/// Local maximum by NLopt's limited-memory BFGS within box constraints; deterministic.
Maximum maximise(const Objective& objective, const Eigen::VectorXd& start, const Eigen::VectorXd& lower,
                 const Eigen::VectorXd& upper, double tolerance = 1e-8, int max_evaluations = 200);

}  // namespace amiss
