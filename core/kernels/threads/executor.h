// core/kernels: work shared by several threads.
//
// The audio thread must never wait for a helper thread in real time, because the system may suspend
// a helper at any moment for any time. A helper therefore performs a task on a copy of its input.
// If it is not done in time, the audio thread performs the task itself on a third copy, and does
// not touch the data of the late helper until the helper has returned.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/rooms.h"

namespace ressort::kernels {

// A unit of work. The caller is the thread that calls Crew::offer().
class Task {
 public:
  virtual ~Task() = default;
  virtual void perform() = 0;        // Works in place [caller, or a helper that is waited for].
  virtual void offer() = 0;          // Copies the input of perform_aside() [caller].
  virtual void perform_aside() = 0;  // Works on the copy [helper].
  virtual void accept() = 0;         // Adopts the result of the copy [caller].
  virtual void take_over() = 0;      // Works on a third copy while a helper is late [caller].
};

// A set of tasks that run at the same time, repeatedly. The caller offers some of them, and then
// finishes them in the same order. It can work on the results of the first ones
// while helpers perform the others. [audio] both functions are wait-free if Executor::is_live():
// all finishes together wait for at most twice the longest task plus the copies.
class Crew {
 public:
  // Returns when no helper is in any of the tasks. [any thread but audio]
  virtual ~Crew() = default;
  // Allows helpers to perform a task, once. Its input is complete.
  virtual void offer(std::uint32_t task) = 0;
  // Returns when an offered task is done. Performs it if no helper does.
  virtual void finish(std::uint32_t task) = 0;
};

// A pool of helper threads.
class Executor {
 public:
  virtual ~Executor() = default;
  virtual std::size_t size() const = 0;  // Number of threads, including the caller's.
  virtual bool is_live() const = 0;      // True if helpers work on copies and are never waited for.
  // Makes a crew; the tasks must outlive it. [any thread but audio]
  virtual std::unique_ptr<Crew> gather(std::vector<Task*> tasks) = 0;
};

}  // namespace ressort::kernels
