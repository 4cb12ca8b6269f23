#include "app/realtime/thread_pool.h"

#include <algorithm>

#include "app/realtime/denormals.h"

namespace ressort {

ThreadPool::ThreadPool(std::size_t count) : start_(count), finish_(count) {
  for (std::size_t i = 1; i < count; ++i) {
    threads_.emplace_back([this, i] { serve(i); });
  }
}

ThreadPool::~ThreadPool() {
  work_ = nullptr;
  start_.wait();
}

void ThreadPool::run(std::size_t count, const std::function<void(std::size_t)>& work) {
  work_ = &work;
  count_ = count;
  start_.wait();
  work(0);
  finish_.wait();
}

void ThreadPool::serve(std::size_t i) {
  const DenormalsFlushed flushed;
  for (start_.wait(); work_ != nullptr; start_.wait()) {
    if (i < count_) {
      (*work_)(i);
    }
    finish_.wait();
  }
}

std::size_t core_count() {
  return std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace ressort
