#pragma once

#include <string>
#include <vector>

#include "engine/linalg/Eigen.hpp"
#include "fmu/Instance.hpp"

namespace amiss::fmu {

/// A value that is set before initialisation: `text` of a string, else `number`.
struct Setting {
  Variable variable;
  double number = 0.0;
  std::string text;
};

/// One run over equal rows.
struct Request {
  std::vector<Setting> settings;
  std::vector<Variable> inputs;
  Eigen::MatrixXd drivers;  // N x inputs: constant within a row
  Variable output;
  double start = 0.0;      // of the first row, s
  double row_s = 0.0;      // length of a row, s
  int steps = 1;           // communication steps of a row
  bool averaged = true;    // whether the result is the mean over each row, or the value at its end
  double tolerance = 0.0;  // asked of the FMU; it is free to choose if this is not positive
};

/// The output at each of N rows. A mean is that of the trapezoidal rule over the communication points of a
/// row, the value at its begin being that at the end of the row before: its error is O(step^2) where the
/// output has no jumps. Throws Failure if the FMU fails, or its output is not finite.
Eigen::VectorXd simulate(Instance& instance, const Request& request);

}  // namespace amiss::fmu
