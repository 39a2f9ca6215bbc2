#pragma once
#include "engine/ais/Sampler.hpp"
#include "engine/ais/StudentT.hpp"
#include "engine/ais/Target.hpp"
#include "engine/discrepancy/HistoryModel.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// Joint posterior of the discrepancy, the error and the parameters, given the whole record. Coordinates:
/// those of the history posterior, then one for each parameter, u = Phi(x).
///
/// Under an error setting with W K = O R, the part of y inside the simulation space is seen as
///     estimate = R^-1 O' W y ~ N(w(z), sigma^2 (R'R)^-1),
/// and with the emulator's mean w' and variance S (equation 5, with one error for inside and outside)
///     p(y | z, ...) = p(H'y | ...) |K'K|^(-1/2) N(estimate; w'(z), S(z) + sigma^2 (R'R)^-1).
/// |K'K|^(-1/2) is the Jacobian that makes this a density of y, whatever the basis.
///
/// The reference is a Student-t mixture close to the history posterior, times the prior of the parameters, so
/// that annealing only has to bring in what the inside part says. The normalising constant is the evidence of
/// the model.
class CalibrationTarget : public Target {
 public:
  CalibrationTarget(const HistoryTarget& history, StudentTMixture reference, const Emulator& emulator);

  Eigen::Index dimension() const override { return history_.dimension() + emulator_.n_inputs(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  Eigen::VectorXd draw_reference(Stream& stream) const override;
  double log_reference(const Eigen::VectorXd& x) const override;

  /// The same posterior from (nearly) the prior of the history coordinates: for a record that contradicts the
  /// history posterior.
  CalibrationTarget from_prior() const;

  /// Parameters in the unit cube, n x P.
  Eigen::MatrixXd unit(const Eigen::MatrixXd& x) const;
  HistoryParameters history(const Eigen::VectorXd& x) const {
    return history_.parameters(x.head(history_.dimension()));
  }

  /// Log density of y inside the simulation space, for coefficients with the given mean and variance.
  double log_density_inside(const HistoryParameters& point, const Eigen::VectorXd& mean,
                            const Eigen::VectorXd& variance) const;

  /// S + sigma^2 (R'R)^-1 and the generalised least squares coefficients, for one point.
  Eigen::MatrixXd covariance_inside(const HistoryParameters& point, const Eigen::VectorXd& variance) const;
  const Eigen::VectorXd& estimate(const HistoryParameters& point) const {
    return history_.model().whitened(point.setting).estimate;
  }
  const Emulator& emulator() const { return emulator_; }
  const HistoryTarget& history_target() const { return history_; }

 private:
  const HistoryTarget& history_;
  StudentTMixture reference_;
  const Emulator& emulator_;
  double log_jacobian_;                           // -1/2 log|K'K|
  std::vector<Eigen::MatrixXd> unit_covariance_;  // (R'R)^-1 of each error setting
};

struct CalibrationSample {
  AisResult posterior;
  /// How far the record lies from what any parameters give inside the simulation space, for some errors drawn
  /// from the history posterior: (estimate - w')'(S + sigma^2 (R'R)^-1)^-1 (estimate - w') at the best
  /// parameters. If the model holds, about chi-squared with one degree of freedom for each basis vector, or
  /// less, as parameters that fit lower it. Not a number where no mode was found.
  Eigen::VectorXd misfits;
};

/// The joint posterior, annealed from the history posterior times the modes of the parameters
/// (parameter_modes()); from the prior of all coordinates where no parameters agree with the history
/// posterior.
CalibrationSample sample_calibration(const CalibrationTarget& target, const AisResult& history,
                                     const AisOptions& options, const Context& context);

}  // namespace amiss
