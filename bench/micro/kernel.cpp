// Google Benchmark: values of equation (6), dense, at low rank and from a skeleton.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "engine/discrepancy/KernelSampling.hpp"
#include "engine/discrepancy/LowRankKernel.hpp"
#include "records.hpp"

namespace amiss::bench {

// Where the posterior of kernel_record(n, 3, seed) lies.
KernelParameters typical_point() {
  KernelParameters p;
  p.decay = -4.0 * (VectorXd(6) << 0.75, 0.92, 0.965, 0.9995, 0.9995, 0.9998).finished().array().log();
  p.amplitude = 8.0;
  p.lambda = 100.0;
  return p;
}

void dense(benchmark::State& state) {
  const KernelModel model = kernel_record(state.range(0), 3, 3);
  KernelModel::Memory memory;
  for (auto _ : state) benchmark::DoNotOptimize(model.log_likelihood(typical_point(), memory));
}
BENCHMARK(dense)->Name("kernel/dense")->Arg(96)->Arg(384)->Arg(1536)->Unit(benchmark::kMillisecond);

// The least that a dense value can cost: one Cholesky factor of that size.
void factor(benchmark::State& state) {
  const Index n = state.range(0);
  MatrixXd a = MatrixXd::Constant(n, n, 0.5), work;
  a.diagonal().array() += 1.0;
  for (auto _ : state) {
    work = a;
    benchmark::DoNotOptimize(Eigen::LLT<Eigen::Ref<MatrixXd>, Eigen::Lower>(work).matrixLLT().data());
  }
}
BENCHMARK(factor)->Name("kernel/cholesky")->Arg(96)->Arg(384)->Arg(1536)->Unit(benchmark::kMillisecond);

void low_rank(benchmark::State& state) {
  const KernelModel model = kernel_record(state.range(0), 3, 3);
  for (auto _ : state) {
    benchmark::DoNotOptimize(low_rank_likelihood(model, typical_point(), 0.01, Certificate::determinant, model.size()));
  }
}
BENCHMARK(low_rank)->Name("kernel/low_rank")->Arg(384)->Arg(1536)->Arg(5760)->Unit(benchmark::kMillisecond);

void skeleton(benchmark::State& state) {
  const KernelModel model = kernel_record(state.range(0), 3, 3);
  const KernelParameters p = typical_point();
  const auto made = KernelSkeleton::make(model, 1.5 * p.decay, 2.0 * p.amplitude * p.lambda, 0.01, model.size());
  KernelSkeleton::Memory memory;
  for (auto _ : state) benchmark::DoNotOptimize(made->log_likelihood(p, memory));
  state.counters["pivots"] = static_cast<double>(made->rank());
}
BENCHMARK(skeleton)->Name("kernel/skeleton")->Arg(384)->Arg(5760)->Arg(11520)->Unit(benchmark::kMillisecond);

// Posterior and log evidence, to a standard error of 0.05 nat; every iteration has a seed of its own, and the
// counters tell the worst of them. Arguments: time steps, conditions that act.
void sampling(benchmark::State& state) {
  const KernelModel model = kernel_record(state.range(0), static_cast<int>(state.range(1)), 3);
  AisOptions options;
  options.precision = 0.05;
  Context context;
  std::map<std::string, double> most;
  double fewest_draws = std::numeric_limits<double>::infinity();
  std::vector<double> estimates;
  double stated = 0.0;  // sum of squared standard errors
  const auto note = [&](const std::string& name, double value) { most[name] = std::max(most[name], value); };
  for (auto _ : state) {
    const KernelSample sample = sample_kernel(model, options, {}, context);
    ++context.seed;
    const AisResult& posterior = sample.posterior;
    note("standard_error", posterior.standard_error);
    note("annealed_apart", std::abs(posterior.log_evidence - posterior.annealed) / posterior.annealed_se);
    note("values", static_cast<double>(posterior.evaluations));
    note("direct", static_cast<double>(sample.direct));
    note("largest_error", sample.largest_error);
    fewest_draws = std::min(fewest_draws, posterior.ess);
    estimates.push_back(posterior.log_evidence);
    stated += posterior.standard_error * posterior.standard_error;
  }
  for (const auto& [name, value] : most) state.counters[name] = value;
  state.counters["effective_draws"] = fewest_draws;
  const Eigen::Map<const VectorXd> z(estimates.data(), static_cast<Index>(estimates.size()));
  if (z.size() > 1) {
    const double n = static_cast<double>(z.size());
    state.counters["spread"] = std::sqrt((z.array() - z.mean()).square().sum() / (n - 1.0) / (stated / n));
  }
  state.counters["peak_memory"] = peak_memory();
}
BENCHMARK(sampling)->Name("kernel/sampling")->Args({384, 3})->Iterations(8)->Unit(benchmark::kSecond);
BENCHMARK(sampling)
    ->Name("kernel/sampling")
    ->Args({5760, 3})
    ->Args({5760, 5})
    ->Args({8760, 3})
    ->Args({11520, 3})
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

}  // namespace amiss::bench

BENCHMARK_MAIN();
