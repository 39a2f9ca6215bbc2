#pragma once
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Memory for a matrix that is needed again and again, in different sizes: kept, and grown where that is not
/// enough. Fresh pages cost as much as the arithmetic of a small matrix, and threads wait for one another to
/// get them.
class Scratch {
 public:
  /// Its elements are what was left there.
  Eigen::Map<Eigen::MatrixXd> matrix(Eigen::Index rows, Eigen::Index cols) {
    if (data_.size() < rows * cols) data_.resize(rows * cols);
    return {data_.data(), rows, cols};
  }

 private:
  Eigen::VectorXd data_;
};

}  // namespace amiss
