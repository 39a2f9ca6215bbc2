// Any options of the sampler: refused, or ones that stand when filled in, and with which a small posterior is
// sampled to an evidence that is a number.
#include "engine/ais/AisOptions.hpp"

#include "engine/ais/Sampler.hpp"
#include "input.hpp"

namespace {

using namespace amiss;

// x, twice: one value measured of a point in the plane.
class Plane : public Target {
 public:
  explicit Plane(double sd) : sd_(sd) {}
  Eigen::Index dimension() const override { return 2; }
  Eigen::VectorXd log_likelihood(const Eigen::MatrixXd& x) const override {
    return -0.5 * (x.colwise().sum().array() - 1.0).square().transpose() / (sd_ * sd_);
  }

 private:
  double sd_;
};

AisOptions make_options(fuzz::Input& in) {
  AisOptions options;
  options.gradient = in.flag();
  options.resample = in.flag();
  for (double* field : {&options.precision, &options.ess_drop, &options.effective_draws}) in.perhaps(*field);
  for (int* field : {&options.pilot_chains, &options.groups, &options.max_groups, &options.chains,
                     &options.sweeps, &options.max_sweeps, &options.importance_draws, &options.refit_draws,
                     &options.max_components, &options.max_temperatures})
    in.perhaps(*field, -1, 60);
  return options;
}

// The work of milliseconds.
AisOptions small(AisOptions options) {
  options.pilot_chains = std::clamp(options.pilot_chains, 8, 24);
  options.groups = std::min(options.groups, 3);
  options.max_groups = std::min(options.max_groups, 4);
  options.chains = std::clamp(options.chains, 4, 8);
  options.sweeps = std::min(options.sweeps, 2);
  options.max_sweeps = std::min(options.max_sweeps, 3);
  options.importance_draws = std::min(options.importance_draws, 60);
  options.max_components = std::min(options.max_components, 2);
  options.max_temperatures = std::min(options.max_temperatures, 30);
  return options;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  const AisOptions options = make_options(in);
  fuzz::refusable([&] {
    options.check();
    options.for_dimension(in.integer(1, 200)).check();
    const AisResult result = sample_ais(Plane(in.flag() ? 0.5 : 0.01), small(options), {});
    fuzz::require(std::isfinite(result.log_evidence), "the evidence is a number");
    fuzz::require(result.draws.allFinite() && std::abs(result.weights.sum() - 1.0) < 1e-9,
                  "draws are weighted");
    fuzz::require(!trusted(result.outcome) || std::isfinite(result.standard_error),
                  "what is trusted has an error");
  });
  return 0;
}
