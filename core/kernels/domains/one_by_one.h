// core/kernels: runs tasks one after the other in the caller's thread.
#pragma once

#include <utility>

#include "core/kernels/domains/executor.h"

namespace ressort::kernels {

class OneByOne final : public Crew {
 public:
  explicit OneByOne(std::vector<Task*> tasks) : tasks_(std::move(tasks)) {}
  void run(std::span<const std::uint32_t> wanted) override {
    for (const std::uint32_t i : wanted) {
      tasks_[i]->perform();
    }
  }

 private:
  const std::vector<Task*> tasks_;
};

// The caller's thread without helpers.
class OwnThread final : public Executor {
 public:
  std::size_t size() const override { return 1; }
  bool is_live() const override { return false; }
  std::unique_ptr<Crew> gather(std::vector<Task*> tasks) override {
    return std::make_unique<OneByOne>(std::move(tasks));
  }
};

}  // namespace ressort::kernels
