#include "engine/random/Stream.hpp"

#include <boost/random/gamma_distribution.hpp>

namespace amiss {
namespace {

// splitmix64 (Steele, Lea and Flood 2014): decorrelates neighbouring seeds.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

}  // namespace

Stream::Stream(std::uint64_t seed, std::uint64_t purpose, std::uint64_t item)
    : engine_(mix(mix(mix(seed) ^ purpose) ^ item)) {}

double Stream::gamma(double shape) { return boost::random::gamma_distribution<double>(shape)(engine_); }

Eigen::VectorXd Stream::normals(Eigen::Index n) { return normals(n, 1); }

Eigen::MatrixXd Stream::normals(Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd draws(rows, columns);
  for (Eigen::Index i = 0; i < draws.size(); ++i) draws.data()[i] = normal();
  return draws;
}

}  // namespace amiss
