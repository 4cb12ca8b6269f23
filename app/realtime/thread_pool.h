// app/realtime: threads that step the shards of large networks, where time does not matter:
// rendering.
#pragma once

#include <thread>
#include <vector>

#include "app/realtime/lockfree.h"
#include "core/kernels/domains/sharded.h"

namespace ressort {

class ThreadPool final : public Executor {
 public:
  // With the thread that calls run(), so many; at least 1.
  explicit ThreadPool(std::size_t count);
  ~ThreadPool() override;
  std::size_t size() const override { return threads_.size() + 1; }
  void run(std::size_t count, const std::function<void(std::size_t)>& work) override;  // [control]

 private:
  void serve(std::size_t i);

  Barrier start_;
  Barrier finish_;
  const std::function<void(std::size_t)>* work_ = nullptr;  // null: the threads end
  std::size_t count_ = 0;
  std::vector<std::jthread> threads_;
};

// How many threads this machine runs at once.
std::size_t core_count();

}  // namespace ressort
