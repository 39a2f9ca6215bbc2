#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "ais_helpers.hpp"
#include "engine/Context.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(Context, ForksOfAllSeedsAndPurposesAreUnrelated) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Context context = seeded(seed);
    seeds.insert(seed);
    for (std::uint64_t purpose = 0; purpose < 60; ++purpose) {
      seeds.insert(context.fork(purpose).seed);
      seeds.insert(context.fork(purpose).fork(purpose / 2).seed);
    }
  }
  EXPECT_EQ(seeds.size(), 60u * (1 + 2 * 60));  // none twice: seed 2 forked is not seed 1's second purpose
  EXPECT_NE(Stream(seeded(2).fork(0).seed, 1, 0).uniform(), Stream(seeded(1).fork(1).seed, 1, 0).uniform());
}

TEST(Context, AForkKeepsThreadsAndPolls) {
  int polled = 0;
  Context context = seeded(3, 2);
  context.poll = [&] { ++polled; };
  const Context fork = context.fork(5);
  EXPECT_EQ(fork.threads, 2);
  fork.poll();
  EXPECT_EQ(polled, 1);
  EXPECT_EQ(context.alone().threads, 1);
  EXPECT_EQ(context.alone().seed, 3u);
}

}  // namespace
}  // namespace amiss
