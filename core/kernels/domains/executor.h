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

// Other processes, each of which has as many shards of a network as the others. They call these
// functions in the same order. [any thread but audio]
class Fellows {
 public:
  // One array, which lies here or comes from where it does.
  struct Parcel {
    std::uint32_t number = 0;  // by which those who get it know it
    std::size_t owner = 0;     // process
    void* bytes = nullptr;
    std::size_t size = 0;
    std::span<const std::size_t> takers;  // processes that want it; empty: all of them
  };

  virtual ~Fellows() = default;
  virtual std::size_t own() const = 0;  // number of this process
  // Begins to send and to take parcels, which nobody touches until finish() returns. What is for
  // all is begun by all in the same order.
  virtual void begin(std::span<const Parcel> parcels) = 0;
  virtual void finish() = 0;
  virtual bool all_agree(bool here) = 0;
  // Puts the first process's numbers in the place of every other's. Where the first of them differ
  // all processes end: they are not of one kind.
  virtual void follow_first(std::span<std::uint32_t> numbers) = 0;
};

// Threads that help.
class Executor {
 public:
  virtual ~Executor() = default;
  virtual std::size_t size() const = 0;  // with the caller's thread
  virtual bool is_live() const = 0;      // helpers work aside, and are not waited for
  // The tasks outlive the crew. [any thread but audio]
  virtual std::unique_ptr<Crew> gather(std::vector<Task*> tasks) = 0;
  // Who has the other shards, if these are no threads; null: all shards are here.
  virtual Fellows* fellows() { return nullptr; }
};

}  // namespace ressort::kernels
