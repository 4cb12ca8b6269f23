#include "app/session/work_queue.h"

#include <utility>

namespace ressort::session {

void WorkQueue::add(LoadJob job) {
  {
    const std::lock_guard lock(mutex_);
    if (!is_ending_) {
      newest_load_ = job.request.name;
      loads_.push_back(std::move(job));
      wake_.notify_all();
      return;
    }
  }
  if (job.answer) {
    job.answer(Error{ending});
  }
}

void WorkQueue::add(Inquiry inquiry) {
  constexpr std::size_t most_waiting = 4;
  const char* reason = "busy: too many requests are waiting; try again";
  {
    const std::lock_guard lock(mutex_);
    if (!is_ending_ && inquiries_.size() < most_waiting) {
      inquiries_.push_back(std::move(inquiry));
      wake_.notify_all();
      return;
    }
    reason = is_ending_ ? ending : reason;
  }
  inquiry.refuse(Error{reason});
}

void WorkQueue::set_rate(double rate_hz) {
  const std::lock_guard lock(mutex_);
  rate_hz_ = rate_hz;
  wake_.notify_all();
}

double WorkQueue::rate_hz() const {
  const std::lock_guard lock(mutex_);
  return rate_hz_;
}

std::string WorkQueue::newest_load() const {
  const std::lock_guard lock(mutex_);
  return newest_load_;
}

void WorkQueue::end() {
  const std::lock_guard lock(mutex_);
  is_ending_ = true;
  wake_.notify_all();
}

bool WorkQueue::wait(std::chrono::duration<double> time) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_for(lock, time, [this] { return is_ending_; });
}

std::optional<WorkQueue::Work> WorkQueue::next() {
  using namespace std::chrono_literals;
  Work work;
  std::deque<LoadJob> loads;
  std::deque<Inquiry> refused;
  bool is_over = false;
  {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, 20ms, [this] {
      return is_ending_ || !loads_.empty() || !inquiries_.empty() || has_new_rate();
    });
    loads.swap(loads_);
    is_over = is_ending_;
    if (is_over) {
      refused.swap(inquiries_);
    } else if (loads.empty() && !inquiries_.empty()) {
      work.inquiry = std::move(inquiries_.front());
      inquiries_.pop_front();
    }
    work.has_new_rate = has_new_rate();
  }
  if (!loads.empty() && !is_over) {
    work.load = std::move(loads.back());
    loads.pop_back();
  }
  for (const LoadJob& job : loads) {
    if (job.answer) {
      job.answer(Error{is_over ? ending : replaced});
    }
  }
  for (const Inquiry& inquiry : refused) {
    inquiry.refuse(Error{ending});
  }
  return is_over ? std::nullopt : std::optional(std::move(work));
}

double WorkQueue::built_rate_hz() const {
  const std::lock_guard lock(mutex_);
  return built_rate_hz_;
}

void WorkQueue::set_built_rate(double rate_hz) {
  const std::lock_guard lock(mutex_);
  built_rate_hz_ = rate_hz;
}

bool WorkQueue::has_newer_load() const {
  const std::lock_guard lock(mutex_);
  return is_ending_ || !loads_.empty();
}

bool WorkQueue::has_other_work() const {
  const std::lock_guard lock(mutex_);
  return is_ending_ || !loads_.empty() || has_new_rate();
}

const char* WorkQueue::reason_to_stop() const {
  const std::lock_guard lock(mutex_);
  return is_ending_ ? ending : replaced;
}

}  // namespace ressort::session
