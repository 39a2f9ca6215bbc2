#include "zone/Options.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace amiss::zone {
namespace {

void require_positive(const char* field, double value) {
  if (!(value > 0.0 && std::isfinite(value))) {
    throw std::invalid_argument(std::string("options: ") + field + " must be a finite number above 0; got " +
                                std::to_string(value));
  }
}

}  // namespace

void Options::check() const {
  require_positive("max_substep_s", max_substep_s);
  require_positive("cells", cells);
  require_positive("initial_hours", initial_hours);
  if (spinup < 0) {
    throw std::invalid_argument("options: spinup must not be negative; got " + std::to_string(spinup));
  }
}

}  // namespace amiss::zone
