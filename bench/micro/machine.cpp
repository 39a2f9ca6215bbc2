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
// The Cholesky factor, alone: the limit of a likelihood of so many values.
void dpotrf(benchmark::State& state) {
  const Eigen::Index n = state.range(0);
  Eigen::MatrixXd a = Eigen::MatrixXd::Constant(n, n, 0.5);
  a.diagonal().array() += 1.0;
  Eigen::MatrixXd work(n, n);
  for (auto _ : state) {
    work = a;
    benchmark::DoNotOptimize(Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(work).matrixLLT().data());
  }
  const double flops = static_cast<double>(n) * static_cast<double>(n) * static_cast<double>(n) / 3.0;
  state.counters["flops"] = benchmark::Counter(flops, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(dpotrf)
    ->Name("machine/dpotrf")
    ->Arg(50)
    ->Arg(100)
    ->Arg(200)
    ->Arg(384)
    ->Arg(1000)
    ->Arg(2000)
    ->Unit(benchmark::kMillisecond);

BENCHMARK(dgemm)->Name("machine/dgemm")->Arg(384)->Arg(1000)->Unit(benchmark::kMillisecond);

BENCHMARK_MAIN();
