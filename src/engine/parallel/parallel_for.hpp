#pragma once
#include <functional>

#include "engine/Context.hpp"

namespace amiss {

/// Runs `task(i)` for i = 0 ... n-1 on at most `context.threads` threads made for this call, fewer where
/// the system gives no more. The calling
/// thread only polls for interrupts; with one thread it works and polls between tasks. The first exception of
/// a task (or of the poll) stops the handing out of tasks and is thrown again here once all threads have
/// joined.
void parallel_for(int n, const Context& context, const std::function<void(int)>& task);

}  // namespace amiss
