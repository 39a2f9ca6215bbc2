#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "engine/parallel/parallel_for.hpp"

namespace amiss {
namespace {

struct Interrupted : std::exception {};

Context with_threads(int threads) {
  Context context;
  context.threads = threads;
  return context;
}

void nap() { std::this_thread::sleep_for(std::chrono::milliseconds(2)); }

TEST(ParallelFor, DoesEveryIndexOnce) {
  for (int threads : {1, 2, 3, 50}) {
    for (int n : {0, 1, 2, 17, 1000}) {
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(n));
      for (auto& visit : visits) visit = 0;
      parallel_for(n, with_threads(threads), [&](int i) { ++visits.at(static_cast<std::size_t>(i)); });
      for (int i = 0; i < n; ++i) ASSERT_EQ(visits[i], 1) << "index " << i << ", " << threads << " threads";
    }
  }
}

TEST(ParallelFor, RunsTasksAtTheSameTime) {
  std::atomic<int> started{0};
  std::atomic<bool> met{false};
  // Each of two tasks waits for the other: only met if both run at once.
  parallel_for(2, with_threads(2), [&](int) {
    ++started;
    for (int wait = 0; wait < 2000 && started < 2; ++wait) nap();
    if (started == 2) met = true;
  });
  EXPECT_TRUE(met);
}

TEST(ParallelFor, ExceptionOfATaskArrivesAndStopsTheRest) {
  for (int threads : {1, 2}) {
    std::atomic<int> done{0};
    auto task = [&](int i) {
      if (i == 3) throw std::domain_error("task 3");
      nap();
      ++done;
    };
    try {
      parallel_for(500, with_threads(threads), task);
      FAIL() << "no exception";
    } catch (const std::domain_error& error) {
      EXPECT_STREQ(error.what(), "task 3");
    }
    EXPECT_LT(done, 100) << threads << " threads";
  }
}

TEST(ParallelFor, PollInterrupts) {
  for (int threads : {1, 2}) {
    Context context = with_threads(threads);
    int polls = 0;
    context.poll = [&] {
      if (++polls == 2) throw Interrupted();
    };
    std::atomic<int> done{0};
    const auto task = [&](int) {
      nap();
      ++done;
    };
    EXPECT_THROW(parallel_for(2000, context, task), Interrupted);
    EXPECT_LT(done, 1000) << threads << " threads";
  }
}

TEST(ParallelFor, PollsOnTheCallingThreadOnly) {
  Context context = with_threads(2);
  const auto caller = std::this_thread::get_id();
  int polls = 0;
  bool elsewhere = false;
  context.poll = [&] {
    ++polls;
    elsewhere = elsewhere || std::this_thread::get_id() != caller;
  };
  std::atomic<int> on_caller{0};
  parallel_for(100, context, [&](int) {
    nap();
    if (std::this_thread::get_id() == caller) ++on_caller;
  });
  EXPECT_GT(polls, 0);
  EXPECT_FALSE(elsewhere);
  EXPECT_EQ(on_caller, 0);
}

}  // namespace
}  // namespace amiss
