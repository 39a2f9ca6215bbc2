#pragma once
#include "engine/ais/BentMap.hpp"
#include "engine/ais/StudentT.hpp"

namespace amiss {

/// Monotone maps from skewed coordinates x to even ones z, one for each coordinate: linear between quantiles,
/// and beyond the outer ones.
class SkewMap {
 public:
  /// The map that changes nothing.
  SkewMap() = default;

  /// Sends quantiles of weighted points (columns of x) to those of a standard normal distribution; linear if
  /// the points are near enough to normal (Schwarz criterion). A coordinate of which many points share one
  /// value is left as it is.
  static SkewMap fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights);

  Eigen::MatrixXd even(const Eigen::MatrixXd& x) const;    ///< z of x, points as columns
  Eigen::VectorXd skewed(const Eigen::VectorXd& z) const;  ///< x of z
  Eigen::MatrixXd slope(const Eigen::MatrixXd& x) const;   ///< dz/dx of each coordinate

 private:
  Eigen::MatrixXd knots_;  // of x, one column for each coordinate; no rows: the identity
  Eigen::VectorXd even_knots_;
  Eigen::MatrixXd slopes_;  // dz/dx between two knots
};

/// A mixture of Student t's in coordinates straightened and made even: for posteriors about a curved ridge,
/// or that a prior limits on one side, which no elliptic distribution comes close to.
class SkewedMixture : public Distribution {
 public:
  SkewedMixture(SkewMap map, StudentTMixture mixture) : map_(std::move(map)), mixture_(std::move(mixture)) {}
  SkewedMixture(BentMap bend, SkewMap map, StudentTMixture mixture)
      : bend_(std::move(bend)), map_(std::move(map)), mixture_(std::move(mixture)) {}

  /// As StudentTMixture::fit(), after BentMap::fit() and SkewMap::fit().
  static SkewedMixture fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& weights, int max_components,
                           double dof, Stream& stream);

  Eigen::VectorXd log_densities(const Eigen::MatrixXd& x) const override;
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const override;
  Eigen::VectorXd draw(Stream& stream) const override;

 private:
  BentMap bend_;
  SkewMap map_;
  StudentTMixture mixture_;
};

}  // namespace amiss
