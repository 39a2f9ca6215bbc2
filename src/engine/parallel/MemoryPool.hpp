#pragma once
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace amiss {

/// Working memory lent to tasks on several threads and kept between them: as many pieces as there are
/// borrowers at once.
template <class Memory>
class MemoryPool {
 public:
  /// A piece of memory, given back at the end of its life.
  class Loan {
   public:
    explicit Loan(MemoryPool& pool) : pool_(pool), memory_(pool.take()) {}
    ~Loan() { pool_.give(std::move(memory_)); }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    Memory& operator*() const { return *memory_; }

   private:
    MemoryPool& pool_;
    std::unique_ptr<Memory> memory_;
  };

 private:
  std::unique_ptr<Memory> take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (idle_.empty()) return std::make_unique<Memory>();
    std::unique_ptr<Memory> memory = std::move(idle_.back());
    idle_.pop_back();
    return memory;
  }
  void give(std::unique_ptr<Memory> memory) {
    const std::lock_guard<std::mutex> lock(mutex_);
    idle_.push_back(std::move(memory));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Memory>> idle_;
};

}  // namespace amiss
