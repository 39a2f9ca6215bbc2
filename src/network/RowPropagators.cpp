#include "network/RowPropagators.hpp"

#include <algorithm>

namespace amiss::network {

namespace {

constexpr Eigen::Index kRows = 256;

Eigen::VectorXd flat(const Eigen::MatrixXd& m) {
  return Eigen::Map<const Eigen::VectorXd>(m.data(), m.size());
}

}  // namespace

RowPropagators::RowPropagators(const Network& network, const Coefficients& coefficients,
                               const std::vector<Coefficients>& directions,
                               const Eigen::Ref<const Eigen::MatrixXd>& drivers, const Row& row)
    : network_(network),
      coefficients_(coefficients),
      directions_(directions),
      drivers_(drivers),
      row_(row),
      modulators_(network.modulators()),
      height_((network.nodes + 1) * static_cast<Eigen::Index>(1 + directions.size())) {
  Eigen::VectorXd at = drivers.row(0);
  if (same()) {
    fixed_ = propagator(network, coefficients, directions, at, row);
  } else if (modulators_.size() == 1 && drivers.rows() > 16) {
    const auto values = drivers.col(modulators_[0]);
    series_ = std::make_unique<Chebyshev>(values.minCoeff(), values.maxCoeff(), [&](double value) {
      at[modulators_[0]] = value;
      return flat(propagator(network, coefficients, directions, at, row));
    });
    if (!series_->converged()) series_.reset();
  }
}

Eigen::Map<const Eigen::MatrixXd> RowPropagators::at(Eigen::Index r) {
  if (same()) return {fixed_.data(), fixed_.rows(), fixed_.cols()};
  if (r < first_ || r >= first_ + block_.rows()) fill(r);
  return {block_.row(r - first_).data(), height_, block_.cols() / height_};
}

void RowPropagators::fill(Eigen::Index from) {
  const Eigen::Index count = std::min(kRows, drivers_.rows() - from);
  first_ = from;
  if (series_) {
    block_ = (*series_)(drivers_.col(modulators_[0]).segment(from, count));
    return;
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::VectorXd one =
        flat(propagator(network_, coefficients_, directions_, drivers_.row(from + i), row_));
    if (i == 0) block_.resize(count, one.size());
    block_.row(i) = one;
  }
}

}  // namespace amiss::network
