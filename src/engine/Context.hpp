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
};

}  // namespace amiss
