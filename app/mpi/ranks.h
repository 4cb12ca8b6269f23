// app/mpi: the processes that mpirun has started, each of which steps a shard of a large network.
#pragma once

#include <memory>

#include "app/rooms.h"
#include "core/kernels/domains/executor.h"

namespace ressort::mpi {

// One thread in each process. Made once in a program; all functions by its main thread. Where a
// process ends otherwise than by ~Ranks(), MPI ends all others.
class Ranks final : public Executor {
 public:
  Ranks(int& argc, char**& argv);
  ~Ranks() override;
  std::size_t number() const;  // of this process, from 0
  std::size_t size() const override;
  bool is_live() const override { return false; }
  std::unique_ptr<Crew> gather(std::vector<Task*> tasks) override;
  Fellows* fellows() override;
  // Ends all processes, with an exit code.
  [[noreturn]] void abort(int code);

 private:
  class Post;
  std::unique_ptr<Post> post_;
};

}  // namespace ressort::mpi
