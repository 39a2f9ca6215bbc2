#pragma once
#include <sys/resource.h>

#include <cmath>
#include <cstdint>

#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/discrepancy/KernelModel.hpp"
#include "engine/random/Stream.hpp"

// Records of any length for the benchmarks: four days of weather, whatever the number of steps; the target is a
// function of some conditions with standard deviation 1, and noise of 0.1.
namespace amiss::bench {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The most memory that this process has held so far, MB.
inline double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

constexpr double kDay = 24.0, kTurn = 6.28318530717958648;

/// Outdoor temperature, sun, wind speed and direction, heating; N x 5, each with its own slow or quick changes.
inline MatrixXd weather(Index n, Stream& stream) {
  MatrixXd x(n, 5);
  const double dt = 96.0 / static_cast<double>(n);
  double slow = 0.0, gusts = 0.0, direction = 3.0, heat = 0.0, next = 0.0;
  for (Index i = 0; i < n; ++i) {
    const double hour = dt * static_cast<double>(i);
    slow += -slow * dt / kDay + std::sqrt(2.0 * dt / kDay) * stream.normal();
    gusts += -gusts * dt / 3.0 + std::sqrt(2.0 * dt / 3.0) * stream.normal();
    direction += 0.5 * std::sqrt(dt) * stream.normal();
    if (hour >= next) {
      heat = stream.uniform() < 0.5 ? 1.0 : 0.0;
      next += 6.0;
    }
    x(i, 0) = 10.0 + 5.0 * std::sin(kTurn * (hour - 9.0) / kDay) + 2.0 * slow;
    x(i, 1) = std::max(0.0, 600.0 * std::sin(kTurn * (hour - 6.0) / kDay) * (1.0 - 0.2 * std::abs(slow)));
    x(i, 2) = std::abs(3.0 + 1.5 * gusts);
    x(i, 3) = std::fmod(std::abs(direction), kTurn);
    x(i, 4) = heat;
  }
  return x;
}

inline MatrixXd daily_basis(Index n) {
  MatrixXd k(n, 6);
  for (Index i = 0; i < n; ++i) {
    const double hour = 96.0 * static_cast<double>(i) / static_cast<double>(n);
    k.row(i) << 1.0, std::sin(kTurn * hour / kDay), std::cos(kTurn * hour / kDay), hour / 96.0,
        std::sin(2.0 * kTurn * hour / kDay), std::cos(2.0 * kTurn * hour / kDay);
  }
  return k;
}

/// @param active  conditions that act: 3, or 5 for the hard case
inline KernelModel kernel_record(Index n, int active, std::uint64_t seed) {
  Stream stream(seed, 1, 1);
  KernelData data;
  data.conditions = weather(n, stream);
  data.condition = {0, 1, 2, 3, 4};
  data.fictitious = fictitious_condition(n, seed);
  data.basis = daily_basis(n);
  MatrixXd u = data.conditions.rowwise() - data.conditions.colwise().minCoeff();
  for (Index j = 0; j < 5; ++j) u.col(j) /= u.col(j).maxCoeff();
  VectorXd f = (3.0 * u.col(0).array()).sin() * u.col(2).array() + (2.0 * u.col(1).array()).sin();
  if (active > 3) {
    f.array() += (3.0 * u.col(3).array()).cos() * u.col(4).array() + u.col(0).array() * u.col(4).array();
  }
  f.array() -= f.mean();
  f *= std::sqrt(static_cast<double>(n) / f.squaredNorm());
  data.y = f + 3.0 * data.basis.col(1) + 0.1 * stream.normals(n);
  KernelPriors priors;
  priors.noise.sd = 0.1;
  return KernelModel(data, priors);
}

/// A simulator that moves by 0.3 along each vector of that basis.
inline GaussianSimulator daily_simulator() { return {VectorXd::Zero(6), 0.3 * MatrixXd::Identity(6, 6)}; }

/// Conditions with seven filter columns each; seven of them give p = 49.
inline HistoryData history_record(Index n, Index conditions = 7) {
  Stream stream(5, 1, 1);
  HistoryData data;
  data.basis = daily_basis(n);
  data.moves = data.basis * daily_simulator().root;
  data.responses = stream.normals(n, 7 * conditions);
  for (Index j = 0; j < 7 * conditions; ++j) {
    const double keep = 1.0 - 1.0 / static_cast<double>(1 + 3 * (j % 7));
    for (Index i = 1; i < n; ++i) data.responses(i, j) += keep * data.responses(i - 1, j);
    data.condition.push_back(static_cast<int>(j / 7));
  }
  data.y = data.responses.col(3) + data.responses.col(10) + 0.5 * stream.normals(n);
  data.axis.time = VectorXd::LinSpaced(n, 0.0, static_cast<double>(n - 1));
  data.axis.new_segment.assign(static_cast<std::size_t>(n), false);
  data.axis.new_segment[0] = true;
  return data;
}

}  // namespace amiss::bench
