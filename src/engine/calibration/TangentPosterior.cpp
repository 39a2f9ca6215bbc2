#include "engine/calibration/TangentPosterior.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "engine/ais/Sampler.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/calibration/Calibration.hpp"
#include "engine/linalg/log_sum_exp.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Parameters that change something; the others keep their prior.
std::vector<Index> acting_parameters(const MatrixXd& slopes) {
  std::vector<Index> acting;
  for (Index j = 0; j < slopes.cols(); ++j) {
    if (slopes.col(j).squaredNorm() > 0) acting.push_back(j);
  }
  return acting;
}

// y - f0 + J x0 in place of y, and the slopes that act as the basis.
HistoryData along_tangent(HistoryData data, const std::vector<Index>& acting, const VectorXd& x0,
                          const VectorXd& run, const MatrixXd& slopes) {
  if (slopes.cols() != x0.size() || slopes.rows() != run.size() || run.size() != data.y.size())
    throw std::invalid_argument("tangent: lengths differ");
  data.y += slopes * x0 - run;
  data.basis.resize(run.size(), static_cast<Index>(acting.size()));
  for (std::size_t j = 0; j < acting.size(); ++j)
    data.basis.col(static_cast<Index>(j)) = slopes.col(acting[j]);
  return data;
}

// The parameters given each point, their prior N(0, I).
TangentPosterior parameters_given(const HistoryModel& model, const std::vector<HistoryParameters>& history,
                                  const std::vector<Index>& acting, Index p) {
  const double draws = static_cast<double>(history.size());
  TangentPosterior out;
  out.history = history;
  MatrixXd means = MatrixXd::Zero(p, static_cast<Index>(history.size()));
  out.covariance = MatrixXd::Identity(p, p);
  for (Index i : acting) out.covariance(i, i) = 0.0;
  for (std::size_t k = 0; k < history.size(); ++k) {
    const CoefficientLikelihood::Posterior given = model.given(history[k]).posterior();
    for (std::size_t i = 0; i < acting.size(); ++i) {
      const Index row = static_cast<Index>(i);
      means(acting[i], static_cast<Index>(k)) = given.mean[row];
      for (std::size_t j = 0; j < acting.size(); ++j)
        out.covariance(acting[i], acting[j]) += given.covariance(row, static_cast<Index>(j)) / draws;
    }
  }
  out.mean = means.rowwise().mean();
  means.colwise() -= out.mean;
  out.covariance += means * means.transpose() / draws;
  return out;
}

}  // namespace

TangentPosterior tangent_posterior(HistoryData data, const HistoryPriors& priors, const VectorXd& x0,
                                   const VectorXd& run, const MatrixXd& slopes, int draws,
                                   const AisOptions& options, const Context& context) {
  const std::vector<Index> acting = acting_parameters(slopes);
  const HistoryModel model(along_tangent(std::move(data), acting, x0, run, slopes), priors, context);
  const Index d = static_cast<Index>(acting.size());
  const HistoryTarget target(model, conditions_but(model, {}), {VectorXd::Zero(d), MatrixXd::Identity(d, d)});
  long evaluations = 0;
  const MatrixXd population =
      sample_population(target, StandardNormal(target.dimension()), options, context, evaluations);
  std::vector<HistoryParameters> history;
  for (int k = 0; k < draws; ++k)
    history.push_back(target.parameters(population.col((2 * k + 1) * population.cols() / (2 * draws))));
  return parameters_given(model, history, acting, x0.size());
}

TangentOptimum tangent_given(HistoryData data, const HistoryPriors& priors,
                             const std::vector<HistoryParameters>& history, const VectorXd& x0,
                             const VectorXd& run, const MatrixXd& slopes, const Context& context) {
  const std::vector<Index> acting = acting_parameters(slopes);
  std::vector<int> settings;
  for (const HistoryParameters& point : history) settings.push_back(point.setting);
  const HistoryModel model(along_tangent(std::move(data), acting, x0, run, slopes), priors, context,
                           settings);
  const Index p = static_cast<Index>(acting.size());
  VectorXd here(p);
  for (Index i = 0; i < p; ++i) here[i] = x0[acting[static_cast<std::size_t>(i)]];
  const VectorXd fixed = VectorXd::Zero(p);
  std::vector<CoefficientLikelihood> given;
  VectorXd log_density(static_cast<Index>(history.size()));
  for (const HistoryParameters& point : history) {
    given.push_back(model.given(point));
    log_density[static_cast<Index>(given.size()) - 1] = given.back().log_density(here, fixed);
  }
  const VectorXd weights = normalised_exp(log_density);
  VectorXd score = -here;
  MatrixXd curvature = MatrixXd::Identity(p, p);
  for (std::size_t k = 0; k < given.size(); ++k) {
    score += weights[static_cast<Index>(k)] * given[k].score(here);
    curvature += weights[static_cast<Index>(k)] * given[k].information(fixed);
  }
  const MatrixXd covariance = curvature.llt().solve(MatrixXd::Identity(p, p));
  const VectorXd top = here + covariance * score;
  TangentOptimum out{VectorXd::Zero(x0.size()), MatrixXd::Identity(x0.size(), x0.size())};
  for (Index i = 0; i < p; ++i) {
    const Index row = acting[static_cast<std::size_t>(i)];
    out.mean[row] = top[i];
    for (Index j = 0; j < p; ++j) out.covariance(row, acting[static_cast<std::size_t>(j)]) = covariance(i, j);
  }
  return out;
}

}  // namespace amiss
