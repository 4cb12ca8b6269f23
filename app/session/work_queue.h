// app/session: requests to the worker thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "app/session/files.h"
#include "core/analysis/modes/tune.h"
#include "core/result.h"

namespace ressort::session {

struct Loaded;

inline constexpr const char* ending = "the program is ending";
inline constexpr const char* replaced = "replaced by a newer load";

struct LoadRequest {
  std::string name;
  bool force = false;                // play it even if it is unstable
  Reach reach = Reach::any_file;     // folders that the name may refer to
  bool lets_ring = false;            // sounding notes ring out
  std::optional<TuneTarget> target;  // tune a mode of the playing scene and load the result
};

struct LoadJob {
  LoadRequest request;
  std::function<void(const Result<std::shared_ptr<const Loaded>>&)> answer;
};

// A question about the playing scene. A load interrupts it.
struct Inquiry {
  std::function<void()> work;  // answers
  std::function<void(const Error&)> refuse;
};

class WorkQueue {
 public:
  // `rate_hz`: the sample rate at the start.
  explicit WorkQueue(double rate_hz) : rate_hz_(rate_hz), built_rate_hz_(rate_hz) {}

  // [any thread but audio]: after end(), both refuse at once.
  void add(LoadJob job);
  void add(Inquiry inquiry);
  void set_rate(double rate_hz);
  double rate_hz() const;
  // The name of the scene that was asked for last, loaded or not; empty before the first.
  std::string newest_load() const;
  void end();
  // Returns true after this time, or false as soon as the program ends.
  bool wait(std::chrono::duration<double> time);

  struct Work {
    std::optional<LoadJob> load;
    std::optional<Inquiry> inquiry;
    bool has_new_rate = false;
  };
  // Waits for work, at most 20 ms. Returns the newest load or the oldest inquiry and refuses older
  // loads; returns nothing when the program ends. [worker]
  std::optional<Work> next();

  // The rate that the playing scene was compiled for. [worker]
  double built_rate_hz() const;
  void set_built_rate(double rate_hz);

  // Returns true if the worker should give up what it is doing: a load is waiting, or the program
  // ends.
  bool has_newer_load() const;
  // The same, or the sample rate has changed.
  bool has_other_work() const;
  // The error message of interrupted work.
  const char* reason_to_stop() const;

 private:
  bool has_new_rate() const { return rate_hz_ != built_rate_hz_; }

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  std::deque<LoadJob> loads_;
  std::string newest_load_;
  std::deque<Inquiry> inquiries_;
  bool is_ending_ = false;
  double rate_hz_;        // rate of the backend
  double built_rate_hz_;  // rate of the playing scene, or of the last attempt
};

}  // namespace ressort::session
