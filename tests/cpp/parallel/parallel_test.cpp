#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "engine/parallel/MemoryPool.hpp"
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

// Address space for a few stacks of threads and no more.
class LittleMemory {
 public:
  LittleMemory() {
    getrlimit(RLIMIT_AS, &before_);
    long pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = static_cast<rlim_t>(pages * sysconf(_SC_PAGESIZE)) + (40u << 20);
    setrlimit(RLIMIT_AS, &limit);
  }
  ~LittleMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_;
};

TEST(ParallelFor, MakesDoWithTheThreadsThereAre) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers reserve address space of their own";
#endif
  std::atomic<int> done{0};
  std::set<std::thread::id> seen;
  std::mutex mutex;
  {
    const LittleMemory little;
    parallel_for(100, with_threads(100), [&](int) {
      nap();
      std::lock_guard<std::mutex> lock(mutex);
      seen.insert(std::this_thread::get_id());
      ++done;
    });
  }
  EXPECT_EQ(done, 100);
  EXPECT_LT(seen.size(), 20u);
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

TEST(MemoryPool, NoTwoTasksHaveTheSamePieceAtOnce) {
  struct Piece {
    int made = 0;
    int value = 0;  // not atomic: the thread sanitizer sees two who write it at once
  };
  MemoryPool<Piece> pool;
  std::atomic<int> fresh{0};
  std::atomic<bool> shared{false};
  parallel_for(200, with_threads(2), [&](int i) {
    const MemoryPool<Piece>::Loan piece(pool);
    if (++(*piece).made == 1) ++fresh;
    (*piece).value = i;
    if (i % 10 == 0) nap();
    if ((*piece).value != i) shared = true;
  });
  EXPECT_FALSE(shared);
  EXPECT_LE(fresh, 2);  // what is given back is lent again
}

}  // namespace
}  // namespace amiss
