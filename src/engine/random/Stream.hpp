#pragma once
#include <boost/random/mersenne_twister.hpp>
#include <boost/random/normal_distribution.hpp>
#include <boost/random/uniform_01.hpp>
#include <cstdint>

#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// One random stream per item of work (chain group, restart, surrogate), never per thread, so that a result
/// depends on the seed alone. Distributions are Boost's: the same bits on every platform.
class Stream {
 public:
  /// The stream number `item` of the purpose `purpose` under `seed`; distinct triples give unrelated streams.
  Stream(std::uint64_t seed, std::uint64_t purpose, std::uint64_t item);

  double uniform() { return uniform_(engine_); }  ///< U(0, 1)
  double normal() { return normal_(engine_); }    ///< N(0, 1)
  double gamma(double shape);                     ///< Gamma(shape, rate 1)
  int index(int n) { return static_cast<int>(uniform() * n); }
  Eigen::VectorXd normals(Eigen::Index n);
  Eigen::MatrixXd normals(Eigen::Index rows, Eigen::Index columns);

 private:
  boost::random::mt19937_64 engine_;
  boost::random::uniform_01<double> uniform_;
  boost::random::normal_distribution<double> normal_;
};

}  // namespace amiss
