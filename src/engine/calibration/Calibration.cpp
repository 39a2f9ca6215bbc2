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
const StartOptions kStart{160, 0.7, 5, 2, {64, 3}};  // for each reach
constexpr double kReferenceDof = 8.0;
constexpr int kRounds = 2;          // that bring the reference closer
constexpr Index kRoundDraws = 100;  // each, per coordinate

struct Start {
  std::vector<MatrixXd> history;  // of each record, draws of equal weight
  ParameterModes modes;
};

// Error and discrepancy of each record under its Gaussian simulator, given a reach (or -1), and where the
// parameters lie then.
Start start_from(const CalibrationTarget& target, const std::vector<GaussianSimulator>& simulators, int reach,
                 const StartOptions& how, const AisOptions& options, const Context& context) {
  AisOptions rough = options;
  rough.pilot_chains = how.chains;
  rough.ess_drop = std::min(options.ess_drop, how.ess_drop);
  rough.max_sweeps = std::min(options.max_sweeps, how.max_sweeps);
  rough.sweeps = std::min(options.sweeps, rough.max_sweeps);
  rough.gradient = false;
  long spent = 0;
  std::vector<HistoryTarget> histories;
  std::vector<MatrixXd> draws;
  std::vector<std::vector<HistoryParameters>> points(static_cast<std::size_t>(how.points));
  for (std::size_t r = 0; r < simulators.size(); ++r) {
    const Record& record = target.records()[r];
    const int largest = static_cast<int>(record.model->priors().reach.size()) - 1;
    histories.emplace_back(*record.model, record.active, simulators[r], std::min(reach, largest));
    const HistoryTarget& history = histories.back();
    draws.push_back(sample_population(history, StandardNormal(history.dimension()), rough,
                                      r == 0 ? context : context.fork(kRecord + r), spent));
    for (int k = 0; k < how.points; ++k)
      points[static_cast<std::size_t>(k)].push_back(
          history.parameters(draws.back().col((2 * k + 1) * draws.back().cols() / (2 * how.points))));
  }
  Stream stream(context.seed, kModes, 0);
  ParameterModes modes = parameter_modes(target, points, how.modes, context, stream);
  modes.evaluations += spent;
  for (std::size_t r = 0; r < draws.size(); ++r) {
    for (Index i = 0; i < draws[r].cols(); ++i)
      draws[r].col(i) = histories[r].with_reach(draws[r].col(i), stream.uniform());
  }
  return {std::move(draws), std::move(modes)};
}

// Each reach has a start of its own: a restrained discrepancy asks for other parameters than a free one, and
// chains that would have to change both at once do not.
CloserReference closer_reference(const CalibrationTarget& target, const AisOptions& options,
                                 const Context& context, long& evaluations) {
  const std::vector<Record>& records = target.records();
  std::vector<GaussianSimulator> simulators;
  std::size_t reaches = 0;
  for (const Record& record : records) {
    simulators.push_back(over_region(*record.emulator));
    reaches = std::max(reaches, record.model->priors().reach.size());
  }
  const Start rough = start_from(target, simulators, -1, kRoughStart, options, context.fork(kFirstHistory));
  evaluations += rough.modes.evaluations;
  for (std::size_t r = 0; r < records.size(); ++r)
    simulators[r] = tangent_at(*records[r].emulator, records[r].inputs(rough.modes.best));
  const Context second = context.fork(kSecondHistory);
  std::vector<std::vector<StudentTMixture>> history(records.size());
  std::vector<StudentTMixture> parameters;
  for (std::size_t k = 0; k < reaches; ++k) {
    const Start start = start_from(target, simulators, static_cast<int>(k), kStart, options, second.fork(k));
    evaluations += start.modes.evaluations;
    Stream stream(second.seed, kMixture, k);
    for (std::size_t r = 0; r < records.size(); ++r) {
      const Index n = start.history[r].cols();
      history[r].push_back(StudentTMixture::fit(start.history[r],
                                                VectorXd::Constant(n, 1.0 / static_cast<double>(n)),
                                                options.max_components, kReferenceDof, stream));
    }
    parameters.push_back(start.modes.mixture);
  }
  std::vector<StudentTMixture> blocks;
  for (const std::vector<StudentTMixture>& mixtures : history)
    blocks.push_back(StudentTMixture::together(mixtures));
  blocks.push_back(StudentTMixture::together(parameters));
  return CloserReference(std::move(blocks));
}

AisResult sample_once(const CalibrationTarget& target, const AisOptions& options, const Context& context) {
  long spent = 0;
  const CloserReference reference = closer_reference(target, options, context, spent);
  const MatrixXd draws = sample_population(target, reference, options, context.fork(kPopulation), spent);
  Stream stream(context.seed, kCloser, 0);
  PopulationMonteCarlo population(target, context, stream);
  population.add(draws);
  const SkewedMixture mixture = population.closer({kRoundDraws * target.dimension(), kRounds});
  spent += population.evaluations();
  const Context last = context.fork(kPosterior);
  AisResult result;
  try {
    result = sample_ais(target, mixture, options, last);
  } catch (const std::runtime_error&) {  // the mixture has lost the posterior: from where it came
    result = sample_ais(target, reference, options, last);
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

namespace {

RecordPosterior record_posterior(const CalibrationTarget& target, std::size_t r,
                                 const Calibration& calibration) {
  const Record& record = target.records()[r];
  const HistoryModel& model = *record.model;
  const AisResult& posterior = calibration.posterior;
  const MatrixXd inputs = record.inputs(posterior.draws.bottomRows(target.parameters()));
  RecordPosterior out;
  out.reach = VectorXd::Zero(static_cast<Index>(model.priors().reach.size()));
  for (Index i = 0; i < posterior.weights.size(); ++i) {
    out.history.push_back(target.history(posterior.draws.col(i), r));
    out.reach[out.history.back().setting / model.error_settings()] += posterior.weights[i];
  }
  const auto kept = static_cast<Index>(calibration.kept.size());
  MatrixXd points(inputs.rows(), kept), mean, variance;
  for (Index k = 0; k < kept; ++k) points.col(k) = inputs.col(calibration.kept[static_cast<std::size_t>(k)]);
  record.emulator->predict_at(points, mean, variance);
  out.coefficients.resize(model.data().responses.cols(), kept);
  const Index moves = model.data().moves.cols();
  out.withheld.resize(moves, kept);
  out.withheld_covariance.resize(moves * moves, kept);
  out.withheld_of_condition = MatrixXd::Zero(moves, model.conditions());
  std::vector<MatrixXd> held(model.priors().reach.size());  // of each reach that is met
  for (Index k = 0; k < kept; ++k) {
    const HistoryParameters& point =
        out.history[static_cast<std::size_t>(calibration.kept[static_cast<std::size_t>(k)])];
    const HistoryModel::Coefficients given =
        model.coefficients(point, mean.row(k).transpose(), variance.row(k).transpose());
    out.coefficients.col(k) = given.mean;
    MatrixXd& withheld = held[static_cast<std::size_t>(point.setting / model.error_settings())];
    if (withheld.size() == 0) withheld = model.withheld(point.setting);
    out.withheld.col(k) = withheld * given.mean;
    for (Index j = 0; j < withheld.cols(); ++j) {
      const int condition = model.data().condition[static_cast<std::size_t>(j)];
      out.withheld_of_condition.col(condition) +=
          withheld.col(j) * (given.mean[j] / static_cast<double>(kept));
    }
    const MatrixXd root = withheld * given.root;
    const MatrixXd covariance = root * root.transpose();
    out.withheld_covariance.col(k) = VectorXd::Map(covariance.data(), covariance.size());
  }
  out.tangent = tangent_at(*record.emulator, inputs * posterior.weights);
  return out;
}

}  // namespace

Calibration calibrate(const std::vector<Record>& records, const CalibrationOptions& options,
                      const Context& context) {
  const CalibrationTarget target(records);
  Calibration out;
  out.posterior = sample_posterior(target, options.ais, context);
  out.unit = target.unit(out.posterior.draws);
  out.kept = spread_draws(out.posterior.weights, options.kept);
  for (std::size_t r = 0; r < records.size(); ++r) out.records.push_back(record_posterior(target, r, out));
  return out;
}

}  // namespace amiss
