#include "engine/error/ErrorModel.hpp"

#include <cmath>
#include <stdexcept>

namespace amiss {

void TimeAxis::check() const {
  if (static_cast<std::size_t>(time.size()) != new_segment.size()) {
    throw std::invalid_argument("TimeAxis: time and new_segment differ in length");
  }
  if (time.size() > 0 && !new_segment[0])
    throw std::invalid_argument("TimeAxis: the first value must start a segment");
  for (Eigen::Index i = 1; i < time.size(); ++i) {
    if (!new_segment[i] && !(time[i] > time[i - 1])) {
      throw std::invalid_argument("TimeAxis: time does not increase at value " + std::to_string(i + 1));
    }
  }
}

int ErrorOptions::settings() const {
  int n = 1;
  for (Eigen::Index k = 0; k < correlation_times.size(); ++k) n *= static_cast<int>(ratios.size());
  return n;
}

Eigen::VectorXd ErrorOptions::setting(int g) const {
  Eigen::VectorXd value(correlation_times.size());
  const int levels = static_cast<int>(ratios.size());
  for (Eigen::Index k = 0; k < value.size(); ++k, g /= levels) value[k] = ratios[g % levels];
  return value;
}

void ErrorOptions::check() const {
  if (!correlation_times.allFinite() || (correlation_times.array() <= 0).any())
    throw std::invalid_argument("error: correlation times must be finite and positive");
  if (!ratios.allFinite() || (ratios.array() < 0).any())
    throw std::invalid_argument("error: variance ratios must be finite and not negative");
  if (correlation_times.size() > 0 && ratios.size() == 0)
    throw std::invalid_argument("error: no variance ratios given");
}

Whitener::Whitener(const TimeAxis& axis, const Eigen::VectorXd& correlation_times,
                   const Eigen::VectorXd& ratios)
    : decay_(Eigen::MatrixXd::Zero(ratios.size(), axis.size())),
      gain_(ratios.size(), axis.size()),
      scale_(axis.size()) {
  Eigen::MatrixXd covariance = ratios.asDiagonal();
  for (Eigen::Index i = 0; i < axis.size(); ++i) {
    if (axis.new_segment[i]) {
      covariance = ratios.asDiagonal();
    } else {
      const Eigen::ArrayXd decay = (-(axis.time[i] - axis.time[i - 1]) / correlation_times.array()).exp();
      covariance = decay.matrix().asDiagonal() * covariance * decay.matrix().asDiagonal();
      covariance.diagonal().array() += ratios.array() * (1.0 - decay.square());
      decay_.col(i) = decay;
    }
    const Eigen::VectorXd with_signal = covariance.rowwise().sum();
    const double variance = 1.0 + with_signal.sum();
    gain_.col(i) = with_signal / variance;
    covariance.noalias() -= with_signal * with_signal.transpose() / variance;
    scale_[i] = 1.0 / std::sqrt(variance);
    log_det_ -= 0.5 * std::log(variance);
  }
}

Eigen::MatrixXd Whitener::operator()(const Eigen::Ref<const Eigen::MatrixXd>& x) const {
  Eigen::MatrixXd state;
  return rows(x, 0, state);
}

Eigen::MatrixXd Whitener::rows(const Eigen::Ref<const Eigen::MatrixXd>& x, Eigen::Index first,
                               Eigen::MatrixXd& state) const {
  const Eigen::Index components = gain_.rows();
  if (components == 0) return x;
  if (first == 0) state.setZero(x.cols(), components);
  // Time runs along the columns here, so that each step of the recursion touches contiguous memory.
  Eigen::MatrixXd series = x.transpose();
  Eigen::VectorXd innovation(series.rows());
  for (Eigen::Index j = 0; j < series.cols(); ++j) {
    const Eigen::Index i = first + j;
    innovation = series.col(j);
    for (Eigen::Index k = 0; k < components; ++k) {
      state.col(k) *= decay_(k, i);  // zero at the start of a segment
      innovation -= state.col(k);
    }
    for (Eigen::Index k = 0; k < components; ++k) state.col(k) += gain_(k, i) * innovation;
    series.col(j) = scale_[i] * innovation;
  }
  return series.transpose();
}

}  // namespace amiss
