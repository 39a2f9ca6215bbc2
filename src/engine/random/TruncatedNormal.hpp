#pragma once
#include "engine/linalg/Eigen.hpp"
#include "engine/random/Stream.hpp"

namespace amiss {

/// Quantile at u of N(centre, 1) between `lower` and `upper`, exact also far outside: from 30 standard
/// deviations on the density falls as an exponential.
double truncated_quantile(double u, double centre, double lower, double upper);

/// Draws (n x p) of N(mean, covariance) with each coordinate between `lower` and `upper`, from `start`, which
/// lies within: by Gibbs steps along the coordinates, so that it leaves a corner of the limits, and along
/// random directions, equal in all of them once the covariance is taken out, so that a narrow ridge does not
/// slow it. Fifty draws, in which `start` is forgotten, come before them.
Eigen::MatrixXd draws_within(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance,
                             const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                             const Eigen::VectorXd& start, int n, Stream& stream);

}  // namespace amiss
