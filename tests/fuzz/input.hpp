#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <vector>

#include "engine/error/ErrorModel.hpp"
#include "engine/linalg/Eigen.hpp"

/// What the fuzzers of this folder share: data made of bytes, and what is asked of the answers.
namespace amiss::fuzz {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Numbers read from the bytes that the fuzzer makes up; zeros once they are used up.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}

  std::uint8_t byte() { return read<std::uint8_t>(); }
  bool flag() { return byte() % 2 == 1; }
  int integer(int low, int high) { return low + byte() % (high - low + 1); }

  /// Most are ordinary, a few are on the edge of what a double can hold or beyond, some are any bits.
  double number() {
    static const double inf = std::numeric_limits<double>::infinity();
    static const std::array<double, 16> edges = {NAN,   inf, -inf, -0.0, 5e-324, 1e-310, -1e-200, 1e-100,
                                                 1e-12, 1e9, -1e9, 1e17, 1e100,  -1e160, 1e300,   -1.7e308};
    const std::uint8_t kind = byte();
    if (kind < edges.size()) return edges[kind];
    if (kind < 32) return read<double>();
    if (kind < 96) return integer(-2, 10);
    return read<std::int16_t>() / (kind < 176 ? 64.0 : 32768.0);
  }

  /// Another value of a field in one of four cases.
  void perhaps(double& field) {
    if (byte() % 4 == 0) field = number();
  }
  void perhaps(int& field, int low, int high) {
    if (byte() % 4 == 0) field = integer(low, high);
  }

  MatrixXd matrix(Index rows, Index columns) {
    return MatrixXd::NullaryExpr(rows, columns, [this] { return number(); });
  }
  VectorXd vector(Index n) { return matrix(n, 1); }

  /// Even or uneven steps, gaps, breaks, and now and then what is no time axis at all.
  TimeAxis axis(Index n) {
    TimeAxis axis{VectorXd(n), std::vector<bool>(static_cast<std::size_t>(n), false)};
    double now = 0.0;
    for (Index i = 0; i < n; ++i) {
      const std::uint8_t kind = byte();
      now = kind < 8 ? number() : now + (kind < 128 ? 1.0 : kind / 64.0);
      axis.time[i] = now;
      axis.new_segment[static_cast<std::size_t>(i)] = i == 0 ? kind != 255 : kind % 16 == 9;
    }
    return axis;
  }

 private:
  template <class Number>
  Number read() {
    Number value{};
    const std::size_t taken = left_ < sizeof value ? left_ : sizeof value;
    if (taken > 0) std::memcpy(&value, at_, taken);
    at_ += taken;
    left_ -= taken;
    return value;
  }

  const std::uint8_t* at_;
  std::size_t left_;
};

/// Whether sums of the numbers' squares can be formed: what is promised of results is promised of these.
template <class Numbers>
bool ordinary(const Numbers& x) {
  return x.allFinite() && (x.size() == 0 || x.cwiseAbs().maxCoeff() < 1e100);
}

inline void require(bool held, const char* what) {
  if (held) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

/// Calls what may refuse its data; other exceptions are findings.
template <class Call>
void refusable(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument&) {
  } catch (const std::runtime_error&) {
  }
}

}  // namespace amiss::fuzz
