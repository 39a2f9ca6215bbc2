#include "engine/emulator/Emulator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "engine/parallel/parallel_for.hpp"
#include "engine/random/Stream.hpp"
#include "engine/random/purposes.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kPoints = 512;  // that stand for a region
constexpr std::uint64_t kRegionSeed = 20;

}  // namespace

Emulator::Emulator(const MatrixXd& inputs, const MatrixXd& coefficients, const MatrixXd& trend)
    : inputs_(inputs), coefficients_(coefficients), trend_(trend), bends_(coefficients) {
  if (inputs.rows() != coefficients.rows())
    throw std::invalid_argument("emulator: inputs and coefficients differ in rows");
  if (inputs.cols() == 0) throw std::invalid_argument("emulator: at least one parameter is needed");
  if (trend.size() > 0 && (trend.rows() != coefficients.cols() || trend.cols() != inputs.cols() + 1))
    throw std::invalid_argument(
        "emulator: the trend needs a row for each coefficient, a column for each slope");
  if (trend.size() > 0) bends_ -= trend_at(inputs);
  centre_ = bends_.colwise().mean();
  const MatrixXd centred = bends_.rowwise() - centre_;
  scale_ = (centred.colwise().squaredNorm() / static_cast<double>(std::max<Index>(1, inputs.rows() - 1)))
               .cwiseSqrt();
  for (Index q = 0; q < scale_.size(); ++q) {
    if (!(scale_[q] > 0)) scale_[q] = 1.0;  // a coefficient that never changes is predicted by its mean
  }
}

MatrixXd Emulator::trend_at(const MatrixXd& inputs) const {
  return (inputs * trend_.rightCols(inputs.cols()).transpose()).rowwise() + trend_.col(0).transpose();
}

Emulator::Emulator(const EmulatorState& state) : Emulator(state.inputs, state.coefficients, state.trend) {
  for (Index q = 0; q < coefficients_.cols(); ++q) {
    processes_.emplace_back(inputs_, (bends_.col(q).array() - centre_[q]) / scale_[q],
                            GaussianProcessParameters::unpack(state.parameters.row(q).transpose()));
  }
  region_ = state.region;
  MatrixXd mean, variance;
  const MatrixXd normal = Stream(kRegionSeed, kRegionPoints, 0).normals(n_inputs(), kPoints);
  predict(region_.inputs(region_.place(normal)), mean, variance);
  typical_variance_.resize(n_outputs());
  for (Index q = 0; q < n_outputs(); ++q) {
    double* const variances = variance.col(q).data();
    std::nth_element(variances, variances + kPoints / 2, variances + kPoints);
    typical_variance_[q] = variances[kPoints / 2];
  }
}

Emulator Emulator::train(const MatrixXd& inputs, const Basis& basis, const EmulatorOptions& options,
                         const Context& context, const MatrixXd& trend) {
  Emulator emulator(inputs, basis.coefficients, trend);
  const double runs = static_cast<double>(inputs.rows());
  const GammaPrior& lambda = options.priors.lambda;
  const double shape = lambda.shape + 0.5 * runs * static_cast<double>(basis.vectors.rows() - basis.size());
  const double largest = basis.singular_values[0];
  const double b = std::isnan(lambda.rate)
                       ? std::sqrt(std::numeric_limits<double>::epsilon()) * largest * largest
                       : lambda.rate;
  const double rate = b + 0.5 * basis.discarded_ss;
  std::vector<std::optional<GaussianProcess>> fitted(static_cast<std::size_t>(basis.size()));
  parallel_for(static_cast<int>(basis.size()), context, [&](int q) {
    const double norm = basis.vectors.col(q).squaredNorm() * emulator.scale_[q] * emulator.scale_[q];
    const VectorXd values = (emulator.bends_.col(q).array() - emulator.centre_[q]) / emulator.scale_[q];
    HyperPriors priors = options.priors;
    priors.lambda = {shape, rate / norm};
    fitted[q] = GaussianProcess::fit(inputs, values, priors, options.search);
    fitted[q]->widen(priors);
  });
  for (auto& process : fitted) emulator.processes_.push_back(std::move(*process));
  return emulator;
}

void Emulator::predict(const MatrixXd& inputs, MatrixXd& mean, MatrixXd& variance) const {
  mean.resize(inputs.rows(), n_outputs());
  variance.resize(inputs.rows(), n_outputs());
  for (Index q = 0; q < n_outputs(); ++q) {
    processes_[q].predict(inputs, mean.col(q), variance.col(q));
    mean.col(q) = (mean.col(q).array() * scale_[q] + centre_[q]).matrix();
    variance.col(q) = (variance.col(q).array() + processes_[q].noise()) * (scale_[q] * scale_[q]);
  }
  if (trend_.size() > 0) mean += trend_at(inputs);
}

void Emulator::predict_at(const MatrixXd& points, MatrixXd& mean, MatrixXd& variance) const {
  const MatrixXd inputs = region_.inputs(points);
  if (region_.everywhere()) return predict(inputs, mean, variance);
  mean.resize(inputs.rows(), n_outputs());
  for (Index q = 0; q < n_outputs(); ++q) {
    processes_[static_cast<std::size_t>(q)].predict(inputs, mean.col(q));
    mean.col(q) = (mean.col(q).array() * scale_[q] + centre_[q]).matrix();
  }
  if (trend_.size() > 0) mean += trend_at(inputs);
  variance = typical_variance_.replicate(inputs.rows(), 1);
}

MatrixXd Emulator::slopes_at(const MatrixXd& points, const ByMean& by_mean) const {
  const MatrixXd inputs = region_.inputs(points);
  MatrixXd mean(inputs.rows(), n_outputs()), by_input = MatrixXd::Zero(inputs.rows(), n_inputs());
  std::vector<MatrixXd> slopes(static_cast<std::size_t>(n_outputs()));
  for (Index q = 0; q < n_outputs(); ++q) {
    const auto k = static_cast<std::size_t>(q);
    processes_[k].predict(inputs, mean.col(q), slopes[k]);
    mean.col(q) = (mean.col(q).array() * scale_[q] + centre_[q]).matrix();
  }
  if (trend_.size() > 0) mean += trend_at(inputs);
  const MatrixXd along = by_mean(mean);
  for (Index q = 0; q < n_outputs(); ++q)
    by_input += (along.col(q) * scale_[q]).asDiagonal() * slopes[static_cast<std::size_t>(q)];
  if (trend_.size() > 0) by_input += along * trend_.rightCols(n_inputs());
  return region_.pulled_back(points, by_input);
}

void Emulator::leave_one_out(MatrixXd& mean, MatrixXd& variance) const {
  mean.resize(inputs_.rows(), n_outputs());
  variance.resize(inputs_.rows(), n_outputs());
  for (Index q = 0; q < n_outputs(); ++q) {
    const GaussianProcess& process = processes_[static_cast<std::size_t>(q)];
    if (process.left_out_mean.size() == 0)
      throw std::logic_error(
          "emulator: runs are left out of a trained emulator, not of one made of its state");
    mean.col(q) = (process.left_out_mean.array() * scale_[q] + centre_[q]).matrix();
    variance.col(q) = process.left_out_variance * (scale_[q] * scale_[q]);
  }
  if (trend_.size() > 0) mean += trend_at(inputs_);
}

EmulatorState Emulator::state() const {
  MatrixXd parameters(n_outputs(), n_inputs() + 3);
  for (Index q = 0; q < n_outputs(); ++q) parameters.row(q) = processes_[q].parameters().pack().transpose();
  return {inputs_, coefficients_, parameters, region_, trend_};
}

VectorXd Emulator::widened() const {
  VectorXd factors(n_outputs());
  for (Index q = 0; q < n_outputs(); ++q) factors[q] = processes_[static_cast<std::size_t>(q)].widened;
  return factors;
}

int Emulator::evaluations() const {
  int total = 0;
  for (const auto& process : processes_) total += process.evaluations;
  return total;
}

std::vector<std::vector<SelectionStep>> Emulator::selections() const {
  std::vector<std::vector<SelectionStep>> all;
  for (const auto& process : processes_) all.push_back(process.selection);
  return all;
}

}  // namespace amiss
