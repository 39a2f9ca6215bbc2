// Google Benchmark: the history model. One likelihood with gradient must not know how long the record is.
#include <benchmark/benchmark.h>

#include "records.hpp"

namespace amiss::bench {

HistoryPriors one_setting() {
  HistoryPriors priors;
  priors.noise_sd = 0.5;
  priors.error = {Eigen::Vector2d(2.0, 8.0), VectorXd::Constant(1, 0.5)};
  priors.reach = {20.0};
  return priors;
}

// With gradient, p filter columns and six of the simulator.
void one_likelihood(benchmark::State& state, Index n, Index conditions) {
  const HistoryModel model(history_record(n, conditions), one_setting(), Context());
  const GaussianSimulator simulator = daily_simulator();
  const WhitenedData seen =
      model.whitened(0).in_terms_of(simulator.mean - model.reference(), simulator.root);
  const VectorXd t = VectorXd::Constant(conditions, 0.5);
  VectorXd gradient;
  double log_variance = 0.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(model.log_likelihood(seen, log_variance += 1e-9, t, &gradient));
  }
}

void likelihood(benchmark::State& state) { one_likelihood(state, state.range(0), 7); }
// Against the number of conditions, of seven columns each.
void likelihood_by_conditions(benchmark::State& state) { one_likelihood(state, 2000, state.range(0)); }
BENCHMARK(likelihood_by_conditions)
    ->Name("history/conditions")
    ->RangeMultiplier(2)
    ->Range(2, 32)
    ->Arg(40)
    ->Unit(benchmark::kMicrosecond);

BENCHMARK(likelihood)->Name("history/likelihood")->Arg(384)->Arg(5760)->Arg(525600)->Unit(benchmark::kMicrosecond);

// All that is worked out once for a record, for one setting of error and reach.
void set_up(benchmark::State& state) {
  const HistoryData data = history_record(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(HistoryModel(data, one_setting(), Context()).whitened(0).square);
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
