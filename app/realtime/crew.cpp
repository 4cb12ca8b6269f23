#include "app/realtime/crew.h"

#include <algorithm>

#include "app/realtime/denormals.h"

namespace ressort {

ThreadCrew::ThreadCrew(std::size_t count) : start_(count), finish_(count) {
  for (std::size_t i = 1; i < count; ++i) {
    threads_.emplace_back([this, i] { serve(i); });
  }
}

ThreadCrew::~ThreadCrew() {
  work_ = nullptr;
  start_.wait();
}

void ThreadCrew::run(std::size_t count, const std::function<void(std::size_t)>& work) {
  work_ = &work;
  count_ = count;
  start_.wait();
  work(0);
  finish_.wait();
}

void ThreadCrew::serve(std::size_t i) {
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
