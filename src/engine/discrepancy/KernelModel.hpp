#pragma once
#include <cstdint>
#include <vector>

#include "engine/ais/Target.hpp"
#include "engine/linalg/Eigen.hpp"

namespace amiss {

/// Beta(a, b) prior of a quantity in (0, 1); density proportional to q^(a-1) (1-q)^(b-1).
struct BetaPrior {
  double a = 1.0;
  double b = 1.0;

  void check() const;
  /// The quantile q at u = Phi(x), with 1 - q, so that neither end of (0, 1) loses digits. For a = 1,
  /// 1 - q = (1 - u)^(1/b): half of Beta(1, 0.1) lies above 0.999, and q alone could not tell how close to 1.
  struct Quantile {
    double value = 0.0, complement = 0.0;  ///< q and 1 - q
    double log() const;                    ///< log q
  };
  Quantile quantile(double x) const;
};

/// Prior of the precision of the measurement noise, lambda* ~ Gamma(a*, b*), a* = N c, b* = sd^2 N c (shape
/// and rate; density b*^a* / Gamma(a*) lambda^(a*-1) exp(-b* lambda)): mean 1 / sd^2, relative deviation 1 /
/// sqrt(N c).
struct NoisePrior {
  double sd = 1.0;     ///< stated standard deviation of the noise
  double shape = 2.0;  ///< a* = N c, c in [2/N, 1]: confidence in sd

  void check() const;
  double precision(double x) const;  ///< lambda* at u = Phi(x)
};

/// Priors of equation (6).
struct KernelPriors {
  BetaPrior alpha{1.0, 0.1};
  BetaPrior t2{1.0, 1.0};
  double unit = 1.0;  ///< of the target, in whose square (1 - t2) / t2 is a variance
  NoisePrior noise;

  void check() const;
};

/// The data of equation (6).
struct KernelData {
  Eigen::VectorXd y;           ///< N: the measured target
  Eigen::MatrixXd basis;       ///< N x Q: basis K of the simulation space, of full rank
  Eigen::MatrixXd conditions;  ///< N x columns: boundary conditions at the same time steps, in any unit
  std::vector<int>
      condition;  ///< boundary condition of each column, 0 ... S-1; a circular one has two columns
  Eigen::VectorXd fictitious;  ///< N: x_0, white noise that cannot drive anything

  int count() const;  ///< S
  void check() const;
};

/// White noise for the fictitious condition x_0; depends on n and the seed alone.
Eigen::VectorXd fictitious_condition(Eigen::Index n, std::uint64_t seed);

/// A point of the posterior (6).
struct KernelParameters {
  Eigen::VectorXd decay;   ///< S+1: -4 log(alpha_s), the fictitious condition last
  double amplitude = 1.0;  ///< unit^2 (1 - t2) / t2
  double lambda = 1.0;     ///< lambda*, precision of the noise

  Eigen::VectorXd alpha() const { return (-0.25 * decay).array().exp(); }
  double t2(double unit = 1.0) const { return 1.0 / (1.0 + amplitude / (unit * unit)); }
};

/// Posterior of the discrepancy over time, H v', v' = H'zeta H (H'AH)^-1 v (equation 8), given the
/// hyper-parameters.
struct KernelDiscrepancy {
  Eigen::VectorXd mean, variance;  ///< N, in the order of the record
};

/// Discrepancy of the method's paper (equation 6): v = H'y, H the orthonormal complement of K,
///     v ~ N(0, H'AH),  A = zeta + I / lambda*,  zeta_ij = (1-t2)/t2 prod_s alpha_s^(4 (x_is - x_js)^2).
/// Every condition is scaled to [0, 1]. The columns of one condition (sine and cosine) share alpha_s and one
/// scale, the largest of their ranges, so that distance on the circle keeps its shape.
///
/// H is never formed. With O an orthonormal basis of the columns of K,
///     log|H'AH| = log|A| + log|O'A^-1 O|,
///     v'(H'AH)^-1 v = y'[A^-1 - A^-1 O (O'A^-1 O)^-1 O'A^-1] y,
/// and the value is the normalised density of v,
///     -(N-Q)/2 log(2 pi) - 1/2 log|H'AH| - 1/2 v'(H'AH)^-1 v.
/// As printed in the paper, (6) has (2 pi)^(-1/2), for which the evidence of models of different Q could not
/// be compared; a factor p(z*), though nothing in it depends on z*; a*^b* where the Gamma density has b*^a*;
/// and I lambda* for the covariance of the noise, whose unit only I / lambda* has.
///
/// Neither the order of the time steps nor the numbering of the conditions changes anything, to rounding: the
/// order inside, which is also that of accessors by row, hangs on the values.
///
/// Cost of a value: one N x N matrix product of S+1 columns, N^2/2 exponentials, one Cholesky factor.
class KernelModel {
 public:
  static constexpr double largest_ratio = 1e10;  ///< of discrepancy to noise variance

  KernelModel(KernelData data, KernelPriors priors);

  /// What a value works in: with B = lambda* A = LL' and W = L^-1 [O, Hv], O'B^-1 O = RR' and the coordinates
  /// of the projection.
  struct Memory {
    Eigen::MatrixXd b;        ///< B, then L in its lower triangle
    Eigen::MatrixXd half;     ///< N x (Q+1): W
    Eigen::MatrixXd root;     ///< Q x Q: R, lower
    Eigen::VectorXd project;  ///< Q: R^-1 O'B^-1 Hv
    double log_det = 0.0;
    double quadratic = 0.0;  ///< of B
  };

  /// Log density of v. -infinity where amplitude * lambda* exceeds largest_ratio: rounding would decide
  /// there.
  double log_likelihood(const KernelParameters& parameters) const;
  /// The same in memory that many values share.
  double log_likelihood(const KernelParameters& parameters, Memory& memory) const;

  /// Its mean is H v', its variance the diagonal of (P - H (H'BH)^-1 H') / lambda*, B = lambda* A, P = HH'.
  KernelDiscrepancy discrepancy(const KernelParameters& parameters) const;

  Eigen::Index size() const { return outside_.size(); }  ///< N
  int conditions() const { return conditions_; }         ///< S, without the fictitious one
  const KernelPriors& priors() const { return priors_; }
  const Eigen::MatrixXd& columns() const { return columns_; }  ///< scaled to width 1, centred on their means
  const std::vector<int>& condition() const { return condition_; }  ///< of each of columns(); x_0 is number S
  const Eigen::MatrixXd& orthonormal() const { return orthonormal_; }  ///< O, N x Q
  const Eigen::VectorXd& outside() const { return outside_; }          ///< H v = y - O O'y
  Eigen::VectorXd in_given_order(const Eigen::VectorXd& by_row) const;
  /// The conditions in an order that hangs on their values alone, the fictitious one last.
  const std::vector<int>& order() const { return order_; }

  /// Every k-th time step, with the same scales of the conditions: a cheaper distribution of the same
  /// parameters.
  KernelModel thinned(Eigen::Index k) const;

 private:
  bool factorise(const KernelParameters& parameters, Memory& work) const;
  void sort_rows(KernelData& data);
  void sort_conditions();

  KernelPriors priors_;
  int conditions_;
  std::vector<int> condition_, order_;
  std::vector<Eigen::Index> row_;      // given time step of each row: rows are sorted by what was measured
  Eigen::MatrixXd columns_, squares_;  // x and x^2
  Eigen::MatrixXd orthonormal_;
  Eigen::VectorXd outside_;
};

/// Posterior (6). Coordinates: alpha of the conditions in KernelModel::order(), t2, lambda*; each is the
/// prior's quantile at Phi(x).
class KernelTarget : public Target {
 public:
  explicit KernelTarget(const KernelModel& model) : model_(model) {}

  Eigen::Index dimension() const override { return model_.conditions() + 3; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  KernelParameters parameters(const Eigen::VectorXd& x) const;

 private:
  const KernelModel& model_;
};

}  // namespace amiss
