#pragma once

#include <memory>
#include <vector>

#include "network/Chebyshev.hpp"
#include "network/Propagator.hpp"

namespace amiss::network {

/// Propagators of all rows of a run, some hundred rows at a time.
class RowPropagators {
 public:
  RowPropagators(const Network& network, const Coefficients& coefficients,
                 const std::vector<Coefficients>& directions,
                 const Eigen::Ref<const Eigen::MatrixXd>& drivers, const Row& row);

  /// Whether they are the same in all rows.
  bool same() const { return modulators_.empty(); }

  /// That of row r. Rows are asked for in ascending order.
  Eigen::Map<const Eigen::MatrixXd> at(Eigen::Index r);

 private:
  void fill(Eigen::Index from);

  const Network& network_;
  const Coefficients& coefficients_;
  const std::vector<Coefficients>& directions_;
  Eigen::Ref<const Eigen::MatrixXd> drivers_;
  Row row_;
  std::vector<int> modulators_;
  Eigen::MatrixXd fixed_;                                                         // if nothing modulates
  std::unique_ptr<Chebyshev> series_;                                             // if one driver does
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> block_;  // a row each
  Eigen::Index first_ = 0, height_;
};

}  // namespace amiss::network
