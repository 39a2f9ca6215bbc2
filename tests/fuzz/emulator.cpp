// Any inputs and runs: refused, or processes whose predictions are finite, stored and made again too.
#include "engine/emulator/Emulator.hpp"

#include "input.hpp"

namespace {

using namespace amiss;
using Eigen::Index;
using Eigen::MatrixXd;

void require_predictions(const MatrixXd& mean, const MatrixXd& variance) {
  fuzz::require(mean.allFinite() && variance.allFinite(), "predictions are finite");
  fuzz::require((variance.array() >= 0).all(), "variances are not negative");
}

EmulatorOptions make_options(fuzz::Input& in) {
  EmulatorOptions options;
  options.search.max_evaluations = in.integer(0, 8);
  options.search.forward = in.flag();
  in.perhaps(options.search.starts, 0, 3);
  in.perhaps(options.search.searches, 0, 2);
  in.perhaps(options.search.significance);
  for (BetaShapes* prior : {&options.priors.s2, &options.priors.eta2, &options.priors.beta}) {
    in.perhaps(prior->a);
    in.perhaps(prior->b);
  }
  in.perhaps(options.priors.lambda.shape);
  in.perhaps(options.priors.lambda.rate);
  return options;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  const EmulatorOptions options = make_options(in);
  const Index runs = in.integer(1, 8), inputs = in.integer(0, 3);
  BasisOptions basis_options;
  basis_options.max_vectors = in.integer(2, 4);
  const MatrixXd outputs = in.matrix(in.integer(2, 8), runs);
  MatrixXd at = in.matrix(in.flag() ? runs : in.integer(1, 8), inputs);
  const bool in_the_cube = in.flag();
  if (in_the_cube)
    at = at.unaryExpr([](double x) { return std::isfinite(x) ? std::abs(std::fmod(x, 1.0)) : 0.5; });
  fuzz::refusable([&] {
    const Basis basis = make_basis(outputs, basis_options);
    const Emulator emulator = Emulator::train(at, basis, options, {});
    fuzz::require(at.allFinite(), "data that are not finite are refused");
    if (!in_the_cube) return;  // the processes promise nothing elsewhere
    MatrixXd mean, variance;
    emulator.leave_one_out(mean, variance);
    // Infinite where a few runs contradict one another: then a run says nothing of another.
    fuzz::require(mean.allFinite() && (variance.array() >= 0).all(), "runs left out are predicted");
    const Emulator again(emulator.state());
    again.predict(at, mean, variance);
    require_predictions(mean, variance);
    again.predict_at(MatrixXd::Constant(inputs, 1, 0.3), mean, variance);
    require_predictions(mean, variance);
  });
  return 0;
}
