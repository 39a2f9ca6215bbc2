#include "engine/calibration/Record.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd Record::inputs(const Eigen::Ref<const MatrixXd>& all) const {
  MatrixXd rows(static_cast<Index>(parameters.size()), all.cols());
  for (std::size_t p = 0; p < parameters.size(); ++p)
    rows.row(static_cast<Index>(p)) = all.row(parameters[p]);
  return rows;
}

void Record::check() const {
  if (emulator->n_outputs() != model->data().basis.cols())
    throw std::invalid_argument("calibration: the emulator's coefficients do not match the basis");
  if (emulator->n_inputs() != static_cast<Index>(parameters.size()))
    throw std::invalid_argument("calibration: the emulator's inputs do not match the parameters");
}

std::vector<int> conditions_but(const HistoryModel& model, const std::vector<int>& without) {
  std::vector<int> kept;
  for (int s = 0; s < model.conditions(); ++s) {
    if (std::find(without.begin(), without.end(), s) == without.end()) kept.push_back(s);
  }
  return kept;
}

Record whole_record(const HistoryModel& model, const Emulator& emulator) {
  return whole_record(model, conditions_but(model, {}), emulator);
}

Record whole_record(const HistoryModel& model, std::vector<int> active, const Emulator& emulator) {
  std::vector<int> parameters(static_cast<std::size_t>(emulator.n_inputs()));
  std::iota(parameters.begin(), parameters.end(), 0);
  return {&model, std::move(active), &emulator, std::move(parameters)};
}

}  // namespace amiss
