// Any record, basis, responses, priors and time axis: refused, or densities that are numbers, or zero.
#include "engine/discrepancy/HistoryTarget.hpp"

#include "input.hpp"

namespace {

using namespace amiss;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

HistoryData make_data(fuzz::Input& in) {
  const Index n = in.integer(0, 10), columns = in.integer(0, 4);
  HistoryData data;
  data.axis = in.axis(in.byte() == 255 ? n + 1 : n);
  data.y = in.vector(n);
  data.basis = in.matrix(n, in.integer(0, 3));
  data.responses = in.matrix(in.byte() == 255 ? n + 1 : n, columns);
  data.moves = in.matrix(in.byte() == 255 ? n + 1 : n, in.integer(0, 3));
  for (Index j = 0; j < columns; ++j) data.condition.push_back(in.integer(-1, 7) / 3);
  return data;
}

HistoryPriors make_priors(fuzz::Input& in) {
  HistoryPriors priors;
  for (double* field : {&priors.noise_sd, &priors.noise_shape, &priors.discarded_variance, &priors.inclusion,
                        &priors.amplitude})
    in.perhaps(*field);
  priors.error.correlation_times = in.vector(in.integer(0, 2));
  priors.error.ratios = in.vector(in.integer(0, 3));
  for (int k = in.integer(0, 2); k > 0; --k) priors.reach.push_back(in.number());
  return priors;
}

bool density(double value) { return value < std::numeric_limits<double>::infinity(); }

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  const HistoryData record = make_data(in);
  const HistoryPriors priors = make_priors(in);
  fuzz::refusable([&] {
    const HistoryModel model(record, priors, {});
    fuzz::require(record.y.allFinite() && record.basis.allFinite() && record.responses.allFinite(),
                  "data that are not finite are refused");
    std::vector<int> active;
    for (int s = 0; s < model.conditions(); ++s) {
      if (model.columns_per_condition()[s] > 0) active.push_back(s);
    }
    const Index q = record.basis.cols();
    const GaussianSimulator simulator{model.reference(), MatrixXd::Identity(q, q)};
    const HistoryTarget target(model, active, simulator);
    MatrixXd gradient;
    const MatrixXd x =
        MatrixXd::NullaryExpr(target.dimension(), 2, [&] { return in.integer(-30, 30) / 8.0; });
    const VectorXd values = target.log_likelihood(x, gradient);
    for (Index i = 0; i < x.cols(); ++i) {
      fuzz::require(density(values[i]), "a density is no NaN");
      if (std::isfinite(values[i])) fuzz::require(gradient.col(i).allFinite(), "it has a slope");
      const HistoryParameters point = target.parameters(x.col(i));
      fuzz::require(point.setting >= 0 && point.setting < model.settings() && !std::isnan(point.variance),
                    "a point is one");
      const VectorXd spread = VectorXd::Ones(q);
      const double value = model.log_likelihood(point, model.reference(), spread);
      fuzz::require(density(value), "nor is this");
      if (std::isfinite(
              value))  // sums of squares far beyond it may be no numbers: likelihood zero to a sampler
        fuzz::require(density(model.given(point).log_density(model.reference(), spread)), "nor this");
      model.coefficients(point, model.reference(), VectorXd::Ones(q));
    }
  });
  return 0;
}
