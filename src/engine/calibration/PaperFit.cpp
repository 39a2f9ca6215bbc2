#include "engine/calibration/PaperFit.hpp"

#include "engine/random/purposes.hpp"

namespace amiss {

PaperFit calibrate_paper(const KernelModel& model, const PaperCalibration& coefficients,
                         const Emulator& emulator, const PaperOptions& options, const Context& context) {
  PaperFit fit;
  const KernelTarget outside(model);
  if (options.tolerance > 0) {
    KernelSamplingOptions sampling;
    sampling.tolerance = options.tolerance;
    fit.outside = sample_kernel(model, options.ais, sampling, context);
  } else {
    fit.outside.posterior = sample_ais(outside, options.ais, context);
    fit.outside.direct = fit.outside.posterior.evaluations;
  }
  const Eigen::MatrixXd& draws = fit.outside.posterior.draws;
  for (Eigen::Index i = 0; i < draws.cols(); ++i) fit.draws.push_back(outside.parameters(draws.col(i)));

  const PaperCalibrationTarget inside(coefficients, emulator, model.priors().noise, options.shared_lambda);
  fit.inside = sample_ais(inside, options.ais, context.fork(kParameters));
  fit.unit = inside.unit(fit.inside.draws);
  fit.lambda = inside.lambda(fit.inside.draws);
  fit.log_jacobian = coefficients.log_jacobian();
  return fit;
}

}  // namespace amiss
