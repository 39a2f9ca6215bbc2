#pragma once
#include "engine/ais/Target.hpp"
#include "engine/discrepancy/HistoryModel.hpp"

namespace amiss {

/// The sampler's coordinates of error and discrepancy, x ~ N(0, I): sigma, one for each component of the
/// error, one for the reach if there is a choice, one for each active condition, these in an order that hangs
/// on their columns alone: conditions that are numbered otherwise are sampled by the same chains.
class HistoryCoordinates {
 public:
  HistoryCoordinates(const HistoryModel& model, std::vector<int> active);

  Eigen::Index dimension() const { return first_condition() + static_cast<Eigen::Index>(active_.size()); }
  HistoryParameters parameters(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  /// Gradient with respect to x of a function with gradient `natural` with respect to (log sigma^2, log t_1
  /// ... log t_S). The coordinates of the grid have gradient zero: the function is constant between its
  /// jumps.
  Eigen::VectorXd gradient(const Eigen::Ref<const Eigen::VectorXd>& x, const HistoryParameters& point,
                           const Eigen::VectorXd& natural) const;
  bool has_leaps() const;  ///< whether there are settings to choose from
  /// One component of the error to the level next to its own, the variance of the whole error kept; or the
  /// reach. Returns log |dx' / dx|, or -infinity (Target).
  double leap(Eigen::Ref<Eigen::VectorXd> x, Stream& stream) const;
  const HistoryModel& model() const { return *model_; }
  const std::vector<int>& active() const { return active_; }  ///< condition of each of the last coordinates

 private:
  Eigen::Index first_condition() const;
  double noise_share(double x) const;
  double noise_variance(double share) const;
  double noise_slope(double x, double share) const;  ///< d noise_variance / dx

  const HistoryModel* model_;
  std::vector<int> active_;
};

/// A simulator seen as a Gaussian: its coefficients are w = mean + root a, a ~ N(0, I).
struct GaussianSimulator {
  Eigen::VectorXd mean;  ///< Q
  Eigen::MatrixXd root;  ///< Q x r
};

/// Posterior of error and discrepancy when the simulator is a Gaussian: closed in the parameters, so that a
/// value is a matter of microseconds.
class HistoryTarget : public Target {
 public:
  /// @param reach  number of the reach that is taken as given (its coordinate does nothing); -1: none is.
  HistoryTarget(const HistoryModel& model, std::vector<int> active, const GaussianSimulator& simulator,
                int reach = -1);

  Eigen::Index dimension() const override { return coordinates_.dimension(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  bool has_gradient() const override { return true; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x, Eigen::MatrixXd& gradient) const override;
  bool has_leaps() const override { return coordinates_.has_leaps(); }
  double leap(Eigen::Ref<Eigen::VectorXd> x, Stream& stream) const override {
    return coordinates_.leap(x, stream);
  }
  HistoryParameters parameters(const Eigen::VectorXd& x) const;
  /// The same point with the coordinate of the reach, if there is one, where it chooses the given one: u of
  /// the way through its interval.
  Eigen::VectorXd with_reach(Eigen::VectorXd x, double u) const;

 private:
  HistoryCoordinates coordinates_;
  int reach_;
  std::vector<WhitenedData> settings_;  // in terms of the simulator's a
};

}  // namespace amiss
