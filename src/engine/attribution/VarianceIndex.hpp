#pragma once
#include <vector>

#include "engine/Context.hpp"
#include "engine/discrepancy/KernelModel.hpp"

namespace amiss {

struct Interval {
  double lower = 0.0, upper = 0.0;
};

/// Shortest interval between two draws that holds at least `probability` of the weight.
/// @param weights Not negative, any sum above zero.
Interval highest_density_interval(const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                                  double probability);

/// R2_s of each condition at one point of posterior (6), the fictitious one last (S+1 values): the variance
/// of the discrepancy predicted from x_s alone over the variance of v,
///     R2_s = |v_s|^2 / |v|^2,  v_s = H'zeta_s H (H'(zeta_s + I / lambda*) H)^-1 v,
/// zeta_s the covariance of (6) with every other alpha at 1. What is inverted is the covariance of v as seen,
/// so the noise enters by its covariance I / lambda*. (With I lambda* a noise-free record, lambda* to
/// infinity, would be explained to nothing; so it is explained in full.) K holds the vector of ones, so that
/// H v has mean zero over time and squares are variances. R2_s lies in [0, 1]; the R2_s of several conditions
/// need not add up.
///
/// A covariance of one condition is smooth in one or two numbers, so of low rank r: zeta_s = amplitude * LL'
/// by pivoted Cholesky, to a trace of 1e-8 of the noise; cost N r^2.
Eigen::VectorXd variance_shares(const KernelModel& model, const KernelParameters& parameters);

/// The paper's attribution: R~2_s = R2_s - R2_0 over the draws of posterior (6).
struct VarianceIndex {
  Eigen::MatrixXd share;          ///< draws x (S+1): R2_s, the fictitious condition last
  Eigen::MatrixXd difference;     ///< draws x S: R~2_s
  Eigen::VectorXd mean, median;   ///< S: of R~2_s
  std::vector<Interval> hdi;      ///< S: of R~2_s
  std::vector<bool> significant;  ///< S: 0 lies outside the interval
  std::vector<int> rank;          ///< S: 1 has the largest median
};

VarianceIndex variance_index(const KernelModel& model, const std::vector<KernelParameters>& draws,
                             const Eigen::VectorXd& weights, double probability, const Context& context);

}  // namespace amiss
