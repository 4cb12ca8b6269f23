// core/kernels: work that several threads share.
//
// Live, the thread that wants it done must never wait for a thread that helps: who helps may be
// stopped by the system at any moment, for any time. So a helper does a task aside, in a copy of
// what it starts from. If that is not done in time, whoever wants it does the task himself in a
// third place, and leaves to the late one all that it reads or writes, until it has come back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::kernels {

// A piece of work. The caller is who calls Crew::run().
class Task {
 public:
  virtual ~Task() = default;
  virtual void perform() = 0;        // where it is [caller, or a helper that is waited for]
  virtual void offer() = 0;          // writes down what perform_aside() needs [caller]
  virtual void perform_aside() = 0;  // in the copy [helper]
  virtual void accept() = 0;         // the copy counts [caller]
  virtual void take_over() = 0;      // a helper is in it: performs it in a third place [caller]
};

// Tasks that are done at the same time, again and again.
class Crew {
 public:
  // Returns when no helper is in any of the tasks. [any thread but audio]
  virtual ~Crew() = default;
  // Does those that are wanted, each once, and returns when they are done.
  // [audio] wait-free if Executor::is_live(): longer than by one thread alone by at most twice what
  // the longest of them takes, and what a copy takes.
  virtual void run(std::span<const std::uint32_t> wanted) = 0;
};

// Threads that help.
class Executor {
 public:
  virtual ~Executor() = default;
  virtual std::size_t size() const = 0;  // with the caller's thread
  virtual bool is_live() const = 0;      // helpers work aside, and are not waited for
  // The tasks outlive the crew. [any thread but audio]
  virtual std::unique_ptr<Crew> gather(std::vector<Task*> tasks) = 0;
};

}  // namespace ressort::kernels
