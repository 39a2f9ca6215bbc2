#include "fmu/simulate.hpp"

#include <cmath>

namespace amiss::fmu {

namespace {

// What is new in a row: an FMU may take a value that is set again for an event.
void set_inputs(Instance& instance, const Request& request, Eigen::Index row) {
  for (std::size_t k = 0; k < request.inputs.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    const double value = request.drivers(row, column);
    if (row == 0 || value != request.drivers(row - 1, column)) instance.set(request.inputs[k], value);
  }
}

void initialize(Instance& instance, const Request& request) {
  for (const Setting& setting : request.settings) {
    if (setting.variable.type == Type::string) {
      instance.set(setting.variable, setting.text);
    } else {
      instance.set(setting.variable, setting.number);
    }
  }
  const double length = request.row_s * static_cast<double>(request.drivers.rows());
  instance.enter_initialization({request.start, request.start + length, request.tolerance});
  set_inputs(instance, request, 0);
  instance.exit_initialization();
}

}  // namespace

Eigen::VectorXd simulate(Instance& instance, const Request& request) {
  initialize(instance, request);
  const Eigen::Index rows = request.drivers.rows();
  const double step = request.row_s / request.steps;
  Eigen::VectorXd result(rows);
  double value = instance.get(request.output);
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (row > 0) set_inputs(instance, request, row);
    double sum = 0.0;
    for (int k = 0; k < request.steps; ++k) {
      const double before = value;
      // Not summed up: rounding would drift over a long record.
      const double done = static_cast<double>(row) * request.steps + k;
      instance.step(request.start + done * step, step);
      value = instance.get(request.output);
      sum += 0.5 * (before + value);
    }
    result[row] = request.averaged ? sum / request.steps : value;
    if (!std::isfinite(result[row]))
      throw Failure("its output is not finite in row " + std::to_string(row + 1), false);
  }
  instance.terminate();
  return result;
}

}  // namespace amiss::fmu
