#pragma once
#include "engine/ais/Target.hpp"
#include "engine/calibration/Record.hpp"
#include "engine/discrepancy/HistoryTarget.hpp"

namespace amiss {

/// Joint posterior of error, discrepancy and parameters, given one or several records: each y as its
/// HistoryModel has it, its coefficients those of its emulator, w ~ N(w'(z), S(z)). Each record has an error
/// and a discrepancy of its own; given these and the parameters, which they share, the records are
/// independent. Coordinates: those of the histories, record by record, then one for each parameter, u =
/// Phi(x). The normalising constant is the evidence of the model, a density of all records. Outside the
/// region of an emulator they count as impossible.
class CalibrationTarget : public Target {
 public:
  /// @param active  conditions that may drive the discrepancy.
  CalibrationTarget(const HistoryModel& model, std::vector<int> active, const Emulator& emulator);
  /// Parameters are numbered from 0 without gaps.
  explicit CalibrationTarget(std::vector<Record> records);

  Eigen::Index dimension() const override { return first_parameter_ + parameters_; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override;
  /// Error and discrepancy; the parameters.
  std::vector<Eigen::Index> parts() const override { return {first_parameter_, parameters_}; }

  bool has_conditional() const override { return true; }
  std::unique_ptr<Conditional> along_last_part(const Eigen::MatrixXd& x) const override;

  bool has_leaps() const override;
  double leap(Eigen::Ref<Eigen::VectorXd> x, Stream& stream) const override;  ///< of one record's error

  HistoryParameters history(const Eigen::VectorXd& x, std::size_t record = 0) const;
  std::vector<HistoryParameters> histories(const Eigen::VectorXd& x) const;  ///< of each record
  Eigen::MatrixXd unit(const Eigen::MatrixXd& x) const;  ///< parameters in the unit cube, n x P
  const std::vector<Record>& records() const { return records_; }
  const HistoryCoordinates& coordinates(std::size_t record) const { return coordinates_[record]; }
  Eigen::Index parameters() const { return parameters_; }

 private:
  std::vector<Record> records_;
  std::vector<HistoryCoordinates> coordinates_;
  std::vector<Eigen::Index> first_;  // coordinate of each record's history
  Eigen::Index first_parameter_ = 0, parameters_ = 0;
};

}  // namespace amiss
