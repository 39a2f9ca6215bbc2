#pragma once

#include <vector>

#include "network/Balance.hpp"

namespace amiss::network {

/// How a row of the drivers is read.
struct Row {
  double step_h = 1.0;  ///< its length, h
  bool linear = false;  ///< drivers run in a line from the row before to this one; else they are constant
  bool mean = true;     ///< the output is its mean over the row; else its value at the end
  int held = -1;        ///< node whose state is prescribed over the row, or -1
};

/// What takes the state over one row, exactly: [x_1; y] = P [x_0; u; d], where u are the inputs (drivers and
/// the constant one) at the start of the row and d, if they are linear, what they gain over it. P is
/// (n + 1) x W, with W = n + m + 1, or n + 2 (m + 1) if linear; the derivatives along D directions stand
/// below it: (1 + D) (n + 1) x W in all.
///
/// From the exponential of the augmented system (Van Loan 1978, IEEE Trans. Autom. Control 23, 395-404):
///
///   d/dt [x; z; u; d] = [A B 0; c e 0 (over the step); 0 0 1 (over the step); 0] [x; z; u; d],
///
/// in which z becomes the mean of y. Its derivative along a direction is the upper right block of the
/// exponential of [M dM; 0 M] (Najfeld and Havel 1995, Adv. Appl. Math. 16, 321-375).
Eigen::MatrixXd propagator(const Network& network, const Coefficients& coefficients,
                           const std::vector<Coefficients>& directions, const Eigen::VectorXd& drivers,
                           const Row& row);

}  // namespace amiss::network
