// Google Benchmark: what the machine can do, one core. Times elsewhere are scaled by it.
#include <benchmark/benchmark.h>

#include "engine/linalg/Eigen.hpp"

void dgemm(benchmark::State& state) {
  const Eigen::Index n = state.range(0);
  const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(n, n, 0.5), b = a;
  Eigen::MatrixXd c(n, n);
  for (auto _ : state) {
    c.noalias() = a * b;
    benchmark::DoNotOptimize(c.data());
  }
  const double flops = 2.0 * static_cast<double>(n) * static_cast<double>(n) * static_cast<double>(n);
  state.counters["flops"] = benchmark::Counter(flops, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(dgemm)->Name("machine/dgemm")->Arg(384)->Arg(1000)->Unit(benchmark::kMillisecond);

BENCHMARK_MAIN();
