#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Inverse of a lower triangular matrix, in place; n^3 / 3 flops, in matrix products. The upper part is
/// neither read nor written.
void invert_lower(Eigen::Ref<Eigen::MatrixXd> l);

/// Lower triangle of L'L, L lower triangular, in place; n^3 / 3 flops. Of L = R^-1, R the Cholesky factor of
/// a matrix, it is that matrix's inverse.
void square_lower(Eigen::Ref<Eigen::MatrixXd> l);

/// Copies the lower triangle to the upper one.
void symmetrise(Eigen::Ref<Eigen::MatrixXd> a);

}  // namespace amiss
