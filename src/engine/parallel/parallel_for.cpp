#include "engine/parallel/parallel_for.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace amiss {
namespace {

void serial_for(int n, const Context& context, const std::function<void(int)>& task) {
  for (int i = 0; i < n; ++i) {
    if (context.poll) context.poll();
    task(i);
  }
}

}  // namespace

void parallel_for(int n, const Context& context, const std::function<void(int)>& task) {
  const int workers = std::min(n, context.threads);
  if (workers <= 1) return serial_for(n, context, task);

  std::atomic<int> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr failure;
  std::mutex mutex;
  std::condition_variable finished;
  int running = workers;

  auto fail = [&](std::exception_ptr error) {
    std::lock_guard<std::mutex> lock(mutex);
    if (!failure) failure = error;
    stop = true;
  };
  auto work = [&] {
    for (int i = next++; i < n && !stop; i = next++) {
      try {
        task(i);
      } catch (...) {
        fail(std::current_exception());
      }
    }
    std::lock_guard<std::mutex> lock(mutex);
    --running;
    finished.notify_one();
  };

  std::vector<std::thread> threads;
  threads.reserve(workers);
  try {
    for (int t = 0; t < workers; ++t) threads.emplace_back(work);
  } catch (const std::system_error&) {  // the system gives no more: with those there are
    std::lock_guard<std::mutex> lock(mutex);
    running -= workers - static_cast<int>(threads.size());
  }
  if (threads.empty()) return serial_for(n, context, task);
  for (bool done = false; !done;) {
    {
      std::unique_lock<std::mutex> lock(mutex);
      done = finished.wait_for(lock, std::chrono::milliseconds(50), [&] { return running == 0; });
    }
    if (!done && context.poll && !stop) {
      try {
        context.poll();
      } catch (...) {
        fail(std::current_exception());
      }
    }
  }
  for (auto& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace amiss
