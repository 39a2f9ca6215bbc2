#pragma once
#include <cstdint>
#include <functional>

namespace amiss {

/// What a computation needs from whoever calls it. The engine prints nothing and keeps no global state.
struct Context {
  std::uint64_t seed = 1;      ///< root of every random stream of the call
  int threads = 1;             ///< worker threads; results do not depend on it
  std::function<void()> poll;  ///< called on the calling thread now and then; throws to interrupt

  /// For a task that runs on one of the threads already: that thread alone, and no poll.
  Context alone() const { return {seed, 1, nullptr}; }

  /// For a part of the computation: the same threads, and streams unrelated to those of this context or of
  /// any other purpose (the finaliser of SplitMix64; Steele, Lea and Flood 2014).
  Context fork(std::uint64_t purpose) const {
    std::uint64_t z = seed + 0x9E3779B97F4A7C15u * (purpose + 1);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return {z ^ (z >> 31), threads, poll};
  }
};

}  // namespace amiss
