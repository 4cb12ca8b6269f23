#include "app/realtime/thread_pool.h"

#include <pthread.h>

#include <algorithm>
#include <chrono>

#include "app/realtime/denormals.h"

namespace ressort::realtime {
namespace {

using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr std::int64_t awake_ns = 400'000;  // a helper polls for work this long after its last task
// a helper wakes this long before the expected start of a period
constexpr std::int64_t lead_ns = 60'000;
constexpr std::int64_t short_nap_ns = 50'000;
constexpr std::int64_t long_nap_ns = 5'000'000;  // nap of helpers that are not needed
constexpr std::int64_t forgotten_ns = 100'000'000;

// Returns the monotonic clock. Reads shared memory, makes no system call.
std::int64_t now_ns() {
  return nanoseconds(steady_clock::now().time_since_epoch()).count();
}

void sleep_until(std::int64_t time_ns) {
  std::this_thread::sleep_until(steady_clock::time_point(nanoseconds(time_ns)));
}

void pause() {
#if defined(__SSE2__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

class ThreadPool::Team final : public Crew {
 public:
  Team(ThreadPool& pool, std::vector<Task*> tasks)
      : pool_(pool),
        tasks_(std::move(tasks)),
        claims_(tasks_.size()),
        is_open_(tasks_.size()),
        is_performed_(tasks_.size()) {
    offered_.reserve(tasks_.size());
  }

  ~Team() override {
    while (pool_.shown_.is_used(this)) {
      std::this_thread::sleep_for(nanoseconds(short_nap_ns));
    }
  }

  void offer(std::uint32_t task) override {
    if (offered_.empty()) {
      is_shown_ = !pool_.threads_.empty() && pool_.shown_.show(this);
      predict_period();
    }
    offered_.push_back(task);
    is_performed_[task] = false;
    is_open_[task] = is_shown_ && claims_[task].is_free();
    if (is_open_[task]) {
      tasks_[task]->offer();
      claims_[task].offer();
    }
  }

  void finish(std::uint32_t task) override {
    if (!is_performed_[task] && !perform_own(task)) {
      await(task);
    }
    if (++finished_ < offered_.size()) {
      return;
    }
    if (is_shown_) {
      pool_.shown_.hide();
    }
    offered_.clear();
    finished_ = 0;
    last_free_ = 0;
    patience_ends_ns_ = 0;
    longest_before_ns_ = longest_ns_ > 0 ? longest_ns_ : longest_before_ns_;
    longest_ns_ = 0;
  }

  // Performs the tasks that it can claim; false if there were none. [helper]
  bool help() {
    bool has_helped = false;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      if (claims_[i].claim()) {
        pool_.is_live() ? tasks_[i]->perform_aside() : tasks_[i]->perform();
        claims_[i].finish();
        has_helped = true;
      }
    }
    return has_helped;
  }

 private:
  // The first offer of a period predicts the start of the next one.
  void predict_period() {
    if (!pool_.is_live()) {
      return;
    }
    const ClockReading reading = pool_.clock_->read();
    if (reading.frame != pool_.frame_ && reading.rate_hz > 0.0) {
      pool_.frame_ = reading.frame;
      const auto period_ns =
          static_cast<std::int64_t>(1e9 * static_cast<double>(reading.period) / reading.rate_hz);
      pool_.period_ns_.set(period_ns);
      pool_.next_ns_.set(now_ns() + period_ns);
    }
  }

  // Performs a task that no helper has claimed; false if one has.
  bool perform_own(std::uint32_t task) {
    if (is_open_[task] && !claims_[task].take_back()) {
      return false;
    }
    is_open_[task] = false;
    is_performed_[task] = true;
    measure([&] { tasks_[task]->perform(); });
    return true;
  }

  // Performs another task, the last one that no helper has claimed; false if there is none. Helpers
  // begin with the first ones.
  bool perform_another() {
    last_free_ = last_free_ > 0 ? last_free_ : offered_.size();
    while (last_free_ > finished_ + 1) {
      const std::uint32_t task = offered_[--last_free_];
      if (!is_performed_[task] && perform_own(task)) {
        return true;
      }
    }
    return false;
  }

  // Waits for the helper that performs a task, and meanwhile performs others. A helper that started
  // in time needs no longer than the longest task of this thread, so all of them together get twice
  // that time. Tasks still unfinished then are taken over.
  void await(std::uint32_t task) {
    while (!claims_[task].is_done()) {
      if (perform_another()) {
        continue;
      }
      if (pool_.is_live()) {
        const std::int64_t time_ns = now_ns();
        patience_ends_ns_ = patience_ends_ns_ > 0
                                ? patience_ends_ns_
                                : time_ns + 2 * std::max(longest_ns_, longest_before_ns_);
        if (time_ns > patience_ends_ns_) {
          break;
        }
      }
      pause();
    }
    if (!pool_.is_live()) {
      return;
    }
    if (claims_[task].leave()) {
      measure([&] { tasks_[task]->take_over(); });
    } else {
      tasks_[task]->accept();
    }
  }

  // Works, and keeps the longest time that a task has taken in this round or the last.
  template <class Work>
  void measure(Work&& work) {
    if (!pool_.is_live()) {
      return work();
    }
    const std::int64_t start_ns = now_ns();
    work();
    longest_ns_ = std::max(longest_ns_, now_ns() - start_ns);
  }

  ThreadPool& pool_;
  const std::vector<Task*> tasks_;
  std::vector<Claim> claims_;           // [task]
  std::vector<bool> is_open_;           // [task] helpers may have claimed it in this round
  std::vector<bool> is_performed_;      // [task] by this thread in this round
  std::vector<std::uint32_t> offered_;  // tasks of this round
  std::size_t finished_ = 0;            // tasks of this round
  std::size_t last_free_ = 0;           // tasks in `offered_` that may be free; 0: all
  bool is_shown_ = false;               // helpers see this team
  std::int64_t longest_ns_ = 0;         // longest task of this thread in this round
  std::int64_t longest_before_ns_ = 0;  // the same in an earlier round
  std::int64_t patience_ends_ns_ = 0;   // 0: this thread has not waited in this round
};

ThreadPool::ThreadPool(std::size_t count, const SeqLock<ClockReading>* live)
    : clock_(live), shown_(count) {
  for (std::size_t i = 1; i < count; ++i) {
    threads_.emplace_back([this, i] { serve(i); });
  }
}

ThreadPool::~ThreadPool() {
  ends_.raise();
}

std::unique_ptr<Crew> ThreadPool::gather(std::vector<Task*> tasks) {
  return std::make_unique<Team>(*this, std::move(tasks));
}

void ThreadPool::set_priority(int priority) {
  sched_param wanted{};
  wanted.sched_priority = priority;
  for (std::jthread& thread : threads_) {
    pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &wanted);
  }
}

void ThreadPool::serve(std::size_t helper) {
  const DenormalsFlushed flushed;
  std::int64_t awake_until_ns = 0;
  std::int64_t nap_ns = short_nap_ns;
  while (!ends_.is_raised()) {
    if (Team* const team = shown_.enter(helper)) {
      const bool has_helped = team->help();
      shown_.leave(helper);
      if (has_helped) {
        awake_until_ns = now_ns() + awake_ns;
        nap_ns = short_nap_ns;
      }
    }
    pause();
    const std::int64_t time_ns = now_ns();
    if (time_ns < awake_until_ns) {
      continue;
    }
    // Sleeps until shortly before the next period, or for longer and longer naps while nobody needs
    // help.
    if (const std::int64_t next_ns = next_period_ns(time_ns); next_ns > 0) {
      sleep_until(next_ns - lead_ns);
      awake_until_ns = next_ns + awake_ns;
    } else {
      sleep_until(time_ns + nap_ns);
      nap_ns = std::min(2 * nap_ns, long_nap_ns);
    }
  }
}

// Returns the start of the first period that is far enough away to sleep; 0 if none is expected.
std::int64_t ThreadPool::next_period_ns(std::int64_t time_ns) const {
  const std::int64_t period_ns = period_ns_.get();
  const std::int64_t next_ns = next_ns_.get();
  const std::int64_t soonest_ns = time_ns + lead_ns;
  if (period_ns <= 0 || time_ns - next_ns > forgotten_ns) {
    return 0;
  }
  return next_ns > soonest_ns ? next_ns
                              : next_ns + ((soonest_ns - next_ns) / period_ns + 1) * period_ns;
}

std::size_t core_count() {
  return std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace ressort::realtime
