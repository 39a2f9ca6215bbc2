#include "engine/ais/AisOptions.hpp"

#include <algorithm>
#include <stdexcept>

namespace amiss {

using Eigen::Index;

namespace {

constexpr int kSweeps = 3;  // unless asked otherwise

}  // namespace

void AisOptions::check() const {
  if ((pilot_chains != 0 && pilot_chains < 8) || groups < 2 || (chains != 0 && chains < 4))
    throw std::invalid_argument("ais: need pilot_chains >= 8, groups >= 2, chains >= 4");
  if (max_groups < groups) throw std::invalid_argument("ais: max_groups must not be below groups");
  if (!(precision > 0)) throw std::invalid_argument("ais: precision must be positive");
  if (sweeps < 0 || max_sweeps < 1 || max_sweeps < sweeps)
    throw std::invalid_argument("ais: sweeps must not be negative, max_sweeps positive and not below them");
  if (!(ess_drop > 0 && ess_drop < 1)) throw std::invalid_argument("ais: ess_drop must lie in (0, 1)");
  if (importance_draws != 0 && importance_draws < 50) {
    throw std::invalid_argument("ais: importance_draws must be 0 (none) or at least 50");
  }
  if (refit_draws < 0 || !(effective_draws >= 0))
    throw std::invalid_argument("ais: refit_draws and effective_draws must not be negative");
  if (max_components < 1 || max_temperatures < 1) throw std::invalid_argument("ais: negative size");
}

AisOptions AisOptions::for_dimension(Index d) const {
  AisOptions filled = *this;
  if (pilot_chains == 0) filled.pilot_chains = static_cast<int>(std::max<Index>(256, 16 * d));
  if (sweeps == 0) filled.sweeps = std::min(kSweeps, max_sweeps);
  if (chains == 0) filled.chains = static_cast<int>(std::max<Index>(32, 3 * d));
  return filled;
}

}  // namespace amiss
