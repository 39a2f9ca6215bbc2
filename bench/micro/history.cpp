// Google Benchmark: the history model. One likelihood with gradient must not know how long the record is.
#include <benchmark/benchmark.h>

#include "records.hpp"

namespace amiss::bench {

HistoryPriors one_setting() {
  HistoryPriors priors;
  priors.error = {Eigen::Vector2d(2.0, 8.0), VectorXd::Constant(1, 0.5)};
  return priors;
}

void likelihood(benchmark::State& state) {
  const HistoryModel model(history_record(state.range(0)), one_setting(), Context());
  const VectorXd t = VectorXd::Constant(7, 0.5);
  VectorXd gradient;
  double log_variance = 0.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(model.log_likelihood(0, log_variance += 1e-9, t, &gradient));
  }
}
// Against the number of conditions, of seven columns each.
void likelihood_by_conditions(benchmark::State& state) {
  const Index s = state.range(0);
  const HistoryModel model(history_record(2000, s), one_setting(), Context());
  const VectorXd t = VectorXd::Constant(s, 0.5);
  VectorXd gradient;
  double log_variance = 0.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(model.log_likelihood(0, log_variance += 1e-9, t, &gradient));
  }
}
BENCHMARK(likelihood_by_conditions)
    ->Name("history/conditions")
    ->RangeMultiplier(2)
    ->Range(2, 32)
    ->Arg(40)
    ->Unit(benchmark::kMicrosecond);

BENCHMARK(likelihood)->Name("history/likelihood")->Arg(384)->Arg(5760)->Arg(525600)->Unit(benchmark::kMicrosecond);

void set_up(benchmark::State& state) {
  const HistoryData data = history_record(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(whiten(data, Eigen::Vector2d(2.0, 8.0), Eigen::Vector2d(0.5, 0.5)));
  }
  state.counters["peak_memory"] = peak_memory();
}
BENCHMARK(set_up)
    ->Name("history/setup")
    ->Arg(384)
    ->Arg(1440)
    ->Arg(5760)
    ->Arg(52560)
    ->Arg(525600)
    ->Unit(benchmark::kMillisecond);

}  // namespace amiss::bench

BENCHMARK_MAIN();
