// app/realtime: threads that help with what is large: the packs of many voices, the shards of a
// network. Rendering, they are waited for. Live they never are: see
// core/kernels/domains/executor.h.
#pragma once

#include <thread>
#include <vector>

#include "app/realtime/lockfree.h"
#include "core/kernels/domains/executor.h"

namespace ressort::realtime {

class ThreadPool final : public Executor {
 public:
  // With the thread that calls Crew::run(), so many; at least 1. `live`: the clock of the process
  // whose audio thread that is; helpers sleep from one of its periods to the next, by themselves.
  // Null: rendering.
  explicit ThreadPool(std::size_t count, const Board<ClockReading>* live = nullptr);
  ~ThreadPool() override;
  std::size_t size() const override { return threads_.size() + 1; }
  bool is_live() const override { return clock_ != nullptr; }
  std::unique_ptr<Crew> gather(std::vector<Task*> tasks) override;
  // Real-time priority for the helpers; without the right to it they stay as they are. [control]
  void set_priority(int priority);
  // Tasks that were taken over from a late helper. [any thread]
  std::uint64_t taken_over() const { return taken_over_.get(); }

 private:
  class Team;
  void serve(std::size_t helper);
  std::int64_t next_period_ns(std::int64_t time_ns) const;

  const Board<ClockReading>* const clock_;
  Shown<Team> shown_;
  Moment next_ns_;           // when the next period begins to need help
  Moment period_ns_;         // 0: not known
  std::int64_t frame_ = -1;  // of the newest period; of whom has shown a team
  Counter taken_over_;
  Flag ends_;
  std::vector<std::jthread> threads_;
};

// How many threads this machine runs at once.
std::size_t core_count();

}  // namespace ressort::realtime
