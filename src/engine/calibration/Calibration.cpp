#include "engine/calibration/Calibration.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "engine/ais/CloserReference.hpp"
#include "engine/ais/PopulationMonteCarlo.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/ais/spread_draws.hpp"
#include "engine/calibration/ParameterModes.hpp"
#include "engine/parallel/parallel_for.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// How error and discrepancy are sampled under a Gaussian simulator, and at how many of the draws the modes of
// the parameters are sought.
struct StartOptions {
  int chains;
  double ess_drop;
  int max_sweeps;
  int points;
  ModeOptions modes;
};
const StartOptions kRoughStart{64, 0.3, 3, 2, {128, 3}};
const StartOptions kStart{96, 0.5, 5, 2, {64, 3}};  // for each reach
constexpr double kReferenceDof = 8.0;
constexpr int kRounds = 2;          // that bring the reference closer
constexpr Index kRoundDraws = 100;  // each, per coordinate

struct Start {
  MatrixXd history;  // draws of equal weight
  ParameterModes modes;
};

// Error and discrepancy under a Gaussian simulator, given a reach (or -1), and where the parameters lie then.
Start start_from(const CalibrationTarget& target, const GaussianSimulator& simulator, int reach,
                 const StartOptions& how, const AisOptions& options, const Context& context) {
  const HistoryTarget history(target.model(), target.coordinates().active(), simulator, reach);
  AisOptions rough = options;
  rough.pilot_chains = how.chains;
  rough.ess_drop = std::min(options.ess_drop, how.ess_drop);
  rough.max_sweeps = std::min(options.max_sweeps, how.max_sweeps);
  rough.sweeps = std::min(options.sweeps, rough.max_sweeps);
  rough.gradient = false;
  long spent = 0;
  MatrixXd draws = sample_population(history, StandardNormal(history.dimension()), rough, context, spent);
  std::vector<HistoryParameters> points;
  for (int k = 0; k < how.points; ++k)
    points.push_back(history.parameters(draws.col((2 * k + 1) * draws.cols() / (2 * how.points))));
  Stream stream(context.seed, kModes, 0);
  ParameterModes modes = parameter_modes(target, points, how.modes, context, stream);
  modes.evaluations += spent;
  for (Index i = 0; i < draws.cols(); ++i) draws.col(i) = history.with_reach(draws.col(i), stream.uniform());
  return {std::move(draws), std::move(modes)};
}

// Each reach has a start of its own: a restrained discrepancy asks for other parameters than a free one, and
// chains that would have to change both at once do not.
CloserReference closer_reference(const CalibrationTarget& target, const AisOptions& options,
                                 const Context& context, long& evaluations) {
  const Emulator& emulator = target.emulator();
  const GaussianSimulator first = over_region(emulator);
  const Start rough = start_from(target, first, -1, kRoughStart, options, context.fork(kFirstHistory));
  evaluations += rough.modes.evaluations;
  const GaussianSimulator tangent = tangent_at(emulator, rough.modes.best);
  const Context second = context.fork(kSecondHistory);
  std::vector<StudentTMixture> history, parameters;
  for (int k = 0; k < static_cast<int>(target.model().priors().reach.size()); ++k) {
    const auto purpose = static_cast<std::uint64_t>(k);
    const Start start = start_from(target, tangent, k, kStart, options, second.fork(purpose));
    evaluations += start.modes.evaluations;
    const Index n = start.history.cols();
    Stream stream(second.seed, kMixture, purpose);
    history.push_back(StudentTMixture::fit(start.history, VectorXd::Constant(n, 1.0 / static_cast<double>(n)),
                                           options.max_components, kReferenceDof, stream));
    parameters.push_back(start.modes.mixture);
  }
  return CloserReference({StudentTMixture::together(history), StudentTMixture::together(parameters)});
}

}  // namespace

namespace {

AisResult sample_once(const CalibrationTarget& target, const AisOptions& options, const Context& context) {
  long spent = 0;
  const CloserReference reference = closer_reference(target, options, context, spent);
  const MatrixXd draws = sample_population(target, reference, options, context.fork(kPopulation), spent);
  Stream stream(context.seed, kCloser, 0);
  PopulationMonteCarlo population(target, context, stream);
  population.add(draws);
  const SkewedMixture mixture = population.closer({kRoundDraws * target.dimension(), kRounds});
  spent += population.evaluations();
  AisOptions skewed = options;
  skewed.skewed = true;
  const Context last = context.fork(kPosterior);
  AisResult result;
  try {
    result = sample_ais(target, mixture, skewed, last);
  } catch (const std::runtime_error&) {  // the mixture has lost the posterior: from where it came
    result = sample_ais(target, reference, skewed, last);
  }
  result.evaluations += spent;
  return result;
}

}  // namespace

// Where the chains got stuck, once more by other random numbers; of two such the one that found more.
AisResult sample_posterior(const CalibrationTarget& target, const AisOptions& options,
                           const Context& context) {
  AisResult result = sample_once(target, options, context);
  if (!stuck(result.outcome)) return result;
  AisResult again = sample_once(target, options, context.fork(kAgain));
  const long evaluations = result.evaluations + again.evaluations;
  if (!stuck(again.outcome) || again.log_evidence > result.log_evidence) result = std::move(again);
  result.evaluations = evaluations;
  return result;
}

std::vector<int> conditions_but(const HistoryModel& model, const std::vector<int>& without) {
  std::vector<int> kept;
  for (int s = 0; s < model.conditions(); ++s) {
    if (std::find(without.begin(), without.end(), s) == without.end()) kept.push_back(s);
  }
  return kept;
}

Calibration calibrate(const HistoryModel& model, const Emulator& emulator, const CalibrationOptions& options,
                      const Context& context) {
  const CalibrationTarget target(model, conditions_but(model, {}), emulator);
  Calibration out;
  out.posterior = sample_posterior(target, options.ais, context);
  const AisResult& posterior = out.posterior;
  out.unit = target.unit(posterior.draws);
  out.reach = VectorXd::Zero(static_cast<Index>(model.priors().reach.size()));
  for (Index i = 0; i < posterior.weights.size(); ++i) {
    out.history.push_back(target.history(posterior.draws.col(i)));
    out.reach[out.history.back().setting / model.error_settings()] += posterior.weights[i];
  }
  out.kept = spread_draws(posterior.weights, options.kept);
  MatrixXd mean, variance;
  MatrixXd points(out.unit.cols(), options.kept);
  for (int k = 0; k < options.kept; ++k)
    points.col(k) = posterior.draws.col(out.kept[static_cast<std::size_t>(k)]).tail(points.rows());
  emulator.predict_at(points, mean, variance);
  out.coefficients.resize(model.data().responses.cols(), options.kept);
  out.withheld.resize(model.data().moves.cols(), options.kept);
  std::vector<MatrixXd> held(model.priors().reach.size());  // of each reach that is met
  for (int k = 0; k < options.kept; ++k) {
    const HistoryParameters& point =
        out.history[static_cast<std::size_t>(out.kept[static_cast<std::size_t>(k)])];
    out.coefficients.col(k) = model.coefficients(point, mean.row(k).transpose(), variance.row(k).transpose());
    MatrixXd& withheld = held[static_cast<std::size_t>(point.setting / model.error_settings())];
    if (withheld.size() == 0) withheld = model.withheld(point.setting);
    out.withheld.col(k) = withheld * out.coefficients.col(k);
  }
  const VectorXd centre = posterior.draws.bottomRows(emulator.n_inputs()) * posterior.weights;
  out.tangent = tangent_at(emulator, centre);
  return out;
}

}  // namespace amiss
