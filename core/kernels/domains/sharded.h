// core/kernels: a large network stepped by several cores, a shard each. In the explicit scheme
// nothing travels farther than one link in a sample: a shard that has a copy of every node within
// a little more than n links of its own goes on by itself for n samples, after which only the
// copies are wrong. They are written anew from the shards whose own they are; what is a shard's own
// is never touched, so that a shard computes what the whole would have.
#pragma once

#include <functional>

#include "core/kernels/kernel.h"

namespace ressort {

// Does several things at the same time.
class Executor {
 public:
  virtual ~Executor() = default;
  virtual std::size_t size() const = 0;  // how many
  // Calls work(i) for every i < count, count <= size(), and returns when all are done.
  virtual void run(std::size_t count, const std::function<void(std::size_t)>& work) = 0;
};

// Where the reference about copies is, that follow one another as what is given does.
struct ShardSource {
  std::uint32_t shard = 0;
  std::uint32_t first = 0;  // of its `given`
  std::uint32_t count = 0;
};

// A Program of its own, with the coefficients of the whole. What does not move is in every shard
// that it touches; of an input or output each shard has its own row, where it has any.
struct Shard {
  Program program;
  std::vector<std::uint32_t> nodes;    // [node] of the whole, ascending
  std::vector<std::uint32_t> inputs;   // [input] of the whole
  std::vector<std::uint32_t> outputs;  // [output] of the whole
  std::vector<std::uint32_t> given;    // own nodes that others have copies of
  std::vector<std::uint32_t> copies;   // nodes that are others' own
  std::vector<ShardSource> sources;    // of all copies, one after the other
};

template <class T>
class ShardedKernel final : public Kernel<T> {
 public:
  // The executor outlives it; every shard's kernel has the same width.
  ShardedKernel(const Program& program, const Shards& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  void let_go(std::size_t lane) override {
    for (const auto& kernel : kernels_) {
      kernel->let_go(lane);
    }
  }
  bool save(std::size_t lane, double* x, double* v) const override;
  bool strike(std::size_t lane, std::uint32_t node, double change) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const override;

 private:
  using Kernels = std::vector<std::unique_ptr<Kernel<T>>>;
  // What a shard's kernel is driven by and fills, as Block says; positions and velocities of the
  // nodes given, and of the copies, [i][lane].
  struct Buffers {
    Aligned<T> value, velocity, outputs;
    Aligned<T> given_x, given_v;
    Aligned<T> copied_x, copied_v;
    std::vector<double> x, v;  // [node] of one lane, for set_state() and save()
  };

  ShardedKernel(const Program& program, const Shards& form, Kernels kernels);
  void play(const Block<T>& block) override;
  void step_shard(std::size_t i, const Block<T>& block, std::size_t at, std::size_t frames);
  void write_copies(std::size_t i);

  const Program& program_;
  const std::vector<Shard>& shards_;
  Executor& executor_;
  std::size_t frames_;
  Kernels kernels_;                       // [shard]
  mutable std::vector<Buffers> buffers_;  // [shard]
};

}  // namespace ressort
