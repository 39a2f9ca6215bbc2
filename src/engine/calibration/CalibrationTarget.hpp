#pragma once
#include "engine/ais/Target.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// Joint posterior of error, discrepancy and parameters, given the record: y as HistoryModel has it, its
/// coefficients those of the emulator, w ~ N(w'(z), S(z)). Coordinates: those of the history, then one for
/// each parameter, u = Phi(x). The normalising constant is the evidence of the model, a density of y. Outside
/// the region of the emulator the record counts as impossible.
class CalibrationTarget : public Target {
 public:
  /// @param active  conditions that may drive the discrepancy.
  CalibrationTarget(const HistoryModel& model, std::vector<int> active, const Emulator& emulator);

  Eigen::Index dimension() const override { return history_.dimension() + emulator_.n_inputs(); }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  /// Error and discrepancy; the parameters.
  std::vector<Eigen::Index> parts() const override { return {history_.dimension(), emulator_.n_inputs()}; }

  bool has_conditional() const override { return true; }
  std::unique_ptr<Conditional> along_last_part(const Eigen::MatrixXd& x) const override;

  HistoryParameters history(const Eigen::VectorXd& x) const {
    return history_.parameters(x.head(history_.dimension()));
  }
  Eigen::MatrixXd unit(const Eigen::MatrixXd& x) const;  ///< parameters in the unit cube, n x P
  const HistoryCoordinates& coordinates() const { return history_; }
  const HistoryModel& model() const { return history_.model(); }
  const Emulator& emulator() const { return emulator_; }

 private:
  HistoryCoordinates history_;
  const Emulator& emulator_;
};

}  // namespace amiss
