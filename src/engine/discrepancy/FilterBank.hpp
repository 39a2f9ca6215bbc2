#pragma once
#include <vector>

#include "engine/error/ErrorModel.hpp"
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Responses of first-order low-pass filters to the boundary conditions: how walls, heaters and sensors pass
/// on what drives them. Column (s, k) answers r' = (x_s - r) / time_constant_k; time constant 0 is x_s
/// itself. Each column starts, in every segment, in equilibrium with the first value.
struct FilterBank {
  Eigen::MatrixXd responses;   ///< N x p
  std::vector<int> condition;  ///< p: which boundary condition a column belongs to

  /// @param x N x C boundary columns. @param condition C: the condition of each column (a circular quantity
  /// has two).
  FilterBank(const Eigen::Ref<const Eigen::MatrixXd>& x, const std::vector<int>& condition,
             const Eigen::VectorXd& time_constants, const TimeAxis& axis);
};

}  // namespace amiss
