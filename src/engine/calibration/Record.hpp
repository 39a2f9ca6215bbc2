#pragma once
#include <vector>

#include "engine/discrepancy/HistoryModel.hpp"
#include "engine/emulator/Emulator.hpp"

namespace amiss {

/// One measured series of a calibration: its error and its discrepancy, and the emulator of what the
/// simulator says of it. Model and emulator live elsewhere and outlive it.
struct Record {
  const HistoryModel* model = nullptr;
  std::vector<int> active;  ///< conditions that may drive its discrepancy
  const Emulator* emulator = nullptr;
  std::vector<int> parameters;  ///< of the calibration: those that are the emulator's inputs, in their order

  /// The inputs' rows of coordinates of all parameters (P x n).
  Eigen::MatrixXd inputs(const Eigen::Ref<const Eigen::MatrixXd>& all) const;
  void check()
      const;  ///< @throws std::invalid_argument unless emulator, basis and parameters are of one size
};

/// Conditions 0 ... S-1 but those of `without`.
std::vector<int> conditions_but(const HistoryModel& model, const std::vector<int>& without);

/// A record whose emulator has all the parameters for inputs, by default with all conditions active.
Record whole_record(const HistoryModel& model, const Emulator& emulator);
Record whole_record(const HistoryModel& model, std::vector<int> active, const Emulator& emulator);

}  // namespace amiss
