#include "engine/calibration/TangentPosterior.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "engine/ais/Sampler.hpp"
#include "engine/ais/StandardNormal.hpp"
#include "engine/calibration/Calibration.hpp"

namespace amiss {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TangentPosterior tangent_posterior(HistoryData data, const HistoryPriors& priors, const VectorXd& x0,
                                   const VectorXd& run, const MatrixXd& slopes, int draws,
                                   const AisOptions& options, const Context& context) {
  const Index p = x0.size();
  if (slopes.cols() != p || slopes.rows() != run.size() || run.size() != data.y.size())
    throw std::invalid_argument("tangent: lengths differ");
  std::vector<Index> acting;  // parameters that change nothing keep their prior
  for (Index j = 0; j < p; ++j) {
    if (slopes.col(j).squaredNorm() > 0) acting.push_back(j);
  }
  const Index d = static_cast<Index>(acting.size());
  data.y -= run;
  data.basis.resize(run.size(), d);
  for (Index j = 0; j < d; ++j) {
    const Index parameter = acting[static_cast<std::size_t>(j)];
    data.basis.col(j) = slopes.col(parameter);
    data.y += x0[parameter] * slopes.col(parameter);
  }
  const HistoryModel model(std::move(data), priors, context);
  const HistoryTarget target(model, conditions_but(model, {}), {VectorXd::Zero(d), MatrixXd::Identity(d, d)});
  long evaluations = 0;
  const MatrixXd population =
      sample_population(target, StandardNormal(target.dimension()), options, context, evaluations);

  TangentPosterior out;
  MatrixXd means = MatrixXd::Zero(p, draws);
  out.covariance = MatrixXd::Zero(p, p);
  for (int k = 0; k < draws; ++k) {
    out.history.push_back(target.parameters(population.col((2 * k + 1) * population.cols() / (2 * draws))));
    const CoefficientLikelihood::Posterior given = model.given(out.history.back()).posterior();
    for (Index i = 0; i < d; ++i) {
      const Index row = acting[static_cast<std::size_t>(i)];
      means(row, k) = given.mean[i];
      for (Index j = 0; j < d; ++j)
        out.covariance(row, acting[static_cast<std::size_t>(j)]) += given.covariance(i, j) / draws;
    }
  }
  for (Index j = 0; j < p; ++j) {
    if (std::find(acting.begin(), acting.end(), j) == acting.end()) out.covariance(j, j) = 1.0;
  }
  out.mean = means.rowwise().mean();
  means.colwise() -= out.mean;
  out.covariance += means * means.transpose() / draws;
  return out;
}

}  // namespace amiss
