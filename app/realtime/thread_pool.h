// app/realtime: helper threads for packs of many voices. The caller waits for them when rendering,
// but never while playing live: see core/kernels/threads/executor.h.
#pragma once

#include <thread>
#include <vector>

#include "app/realtime/lockfree.h"
#include "core/kernels/threads/executor.h"

namespace ressort::realtime {

class ThreadPool final : public Executor {
 public:
  // Makes a pool of `count` threads, at least 1, including the caller of Crew::run(). `live` is the
  // clock of the process that plays: helpers sleep from one of its periods to the next. Null:
  // rendering.
  explicit ThreadPool(std::size_t count, const SeqLock<ClockReading>* live = nullptr);
  ~ThreadPool() override;
  std::size_t size() const override { return threads_.size() + 1; }
  bool is_live() const override { return clock_ != nullptr; }
  std::unique_ptr<Crew> gather(std::vector<Task*> tasks) override;
  // Gives the helpers real-time priority. Does nothing without the permission. [control]
  void set_priority(int priority);

 private:
  class Team;
  void serve(std::size_t helper);
  std::int64_t next_period_ns(std::int64_t time_ns) const;

  const SeqLock<ClockReading>* const clock_;
  HazardPointer<Team> shown_;
  Published<std::int64_t> next_ns_;    // start of the next period that needs help
  Published<std::int64_t> period_ns_;  // 0: unknown
  // frame of the newest period; only the thread that shows a team uses it
  std::int64_t frame_ = -1;
  Flag ends_;
  std::vector<std::jthread> threads_;
};

// Returns the number of hardware threads, at least 1.
std::size_t core_count();

}  // namespace ressort::realtime
