// Google Benchmark: the density of one emulator's hyper-parameters with its gradient, and predictions.
#include <benchmark/benchmark.h>

#include "engine/emulator/GaussianProcess.hpp"
#include "engine/random/Stream.hpp"

namespace amiss::bench {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A nearly linear response over the unit cube.
struct Runs {
  MatrixXd inputs;
  VectorXd values;

  Runs(Index m, Index p) {
    Stream stream(3, 1, 1);
    inputs = 0.5 * (1.0 + stream.normals(m, p).array().sin()).matrix();
    const VectorXd slopes = stream.normals(p);
    values = (inputs * slopes).array() + 0.1 * (3.0 * inputs.col(0).array()).sin();
    values.array() -= values.mean();
    values /= std::sqrt(values.squaredNorm() / static_cast<double>(m));
  }
};

GaussianProcessParameters typical(Index p) {
  GaussianProcessParameters out;
  out.log_amplitude = 3.0;
  out.log_lambda = 40.0;
  out.logit_beta = VectorXd::Constant(p, 3.0);
  return out;
}

void density(benchmark::State& state) {
  const Index m = state.range(0), p = state.range(1);
  const Runs runs(m, p);
  const VectorXd packed = typical(p).pack();
  VectorXd gradient(packed.size());
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        GaussianProcess::log_density(runs.inputs, runs.values, HyperPriors(), packed, gradient));
  }
}
BENCHMARK(density)
    ->Name("emulator/density")
    ->ArgsProduct({{50, 100, 200, 500, 1000, 2000}, {8}})
    ->ArgsProduct({{200}, {3, 5, 10, 20, 40}})
    ->Unit(benchmark::kMillisecond);

// After a search, whose time is that of `fit` below.
void widen(benchmark::State& state) {
  const Runs runs(state.range(0), state.range(1));
  const GaussianProcess fitted = GaussianProcess::fit(runs.inputs, runs.values, HyperPriors(), {});
  for (auto _ : state) {
    state.PauseTiming();
    GaussianProcess process = fitted;
    state.ResumeTiming();
    process.widen(HyperPriors());
    benchmark::DoNotOptimize(process.widened);
  }
}
BENCHMARK(widen)->Name("emulator/widen")->ArgsProduct({{50, 200, 500}, {8}})->Unit(benchmark::kMillisecond);

void fit(benchmark::State& state) {
  const Runs runs(state.range(0), state.range(1));
  for (auto _ : state) {
    const GaussianProcess process = GaussianProcess::fit(runs.inputs, runs.values, HyperPriors(), {});
    benchmark::DoNotOptimize(process.log_joint);
  }
}
BENCHMARK(fit)->Name("emulator/fit")->ArgsProduct({{50, 200, 500}, {8}})->Unit(benchmark::kMillisecond);

// Of 64 points at once, as a group of chains asks for.
void prediction(benchmark::State& state) {
  const Index m = state.range(0), p = 8;
  const Runs runs(m, p);
  const GaussianProcess process(runs.inputs, runs.values, typical(p));
  Stream stream(3, 1, 2);
  const MatrixXd points = 0.5 * (1.0 + stream.normals(64, p).array().sin()).matrix();
  VectorXd mean(64), variance(64);
  for (auto _ : state) {
    process.predict(points, mean, variance);
    benchmark::DoNotOptimize(mean.data());
  }
}
BENCHMARK(prediction)->Name("emulator/prediction")->Arg(50)->Arg(200)->Arg(384)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);

}  // namespace amiss::bench

BENCHMARK_MAIN();
