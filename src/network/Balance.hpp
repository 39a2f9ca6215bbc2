#pragma once

#include "network/Network.hpp"

namespace amiss::network {

/// The equations of a network at one moment: dx/dt = A x + B u + b, y = c x + e u + f. Inputs are the drivers
/// and, last, the constant one, so that B is n x (m + 1) and e has m + 1 numbers.
struct Balance {
  Eigen::MatrixXd states;            ///< A, n x n, 1/h
  Eigen::MatrixXd inputs;            ///< [B, b], n x (m + 1)
  Eigen::RowVectorXd output_states;  ///< c
  Eigen::RowVectorXd output_inputs;  ///< [e, f]
};

/// Of a network whose coefficients are multiplied by `drivers` (their values at the moment; only those of
/// Network::modulators() count). No node is faster than `fastest` (1/h): a capacity that is smaller, or zero,
/// acts as the smallest that is not.
Balance balance(const Network& network, const Coefficients& coefficients, const Eigen::VectorXd& drivers,
                double fastest);

/// Its derivative along `direction`.
Balance derivative(const Network& network, const Coefficients& coefficients, const Coefficients& direction,
                   const Eigen::VectorXd& drivers, double fastest);

}  // namespace amiss::network
