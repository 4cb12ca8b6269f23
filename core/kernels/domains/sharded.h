// core/kernels: a large network stepped by several cores, a shard each. In the explicit scheme
// nothing travels farther than one link in a sample: a shard that has a copy of every node within
// a little more than n links of its own goes on by itself for n samples, after which only the
// copies are wrong. They are written anew from the shards whose own they are; what is a shard's own
// is never touched, so that a shard computes what the whole would have.
#pragma once

#include "core/kernels/domains/kernel_task.h"

namespace ressort::kernels {

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
  std::vector<std::uint32_t> nodes;    // [i] of the whole, ascending
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
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const override;

 private:
  using Kernels = std::vector<std::unique_ptr<Kernel<T>>>;

  ShardedKernel(const Program& program, const Shards& form, Kernels kernels, std::size_t voices,
                Isa isa);
  void play(const Block<T>& block) override;
  void give_inputs(std::size_t i, const Block<T>& block, std::size_t at, std::size_t frames);
  void take_outputs(std::size_t i, const Block<T>& block, std::size_t at, std::size_t frames);
  void gather_copies(std::size_t i) const;
  void place_taps();
  BlockBuffers<T> block_buffers(std::size_t i) const;
  HaloBuffers<T> halo_buffers(std::size_t i) const;
  void write_copies() const;

  const Program& program_;
  const std::vector<Shard>& shards_;
  std::size_t frames_;
  Kernels kernels_;                                    // [shard]
  std::vector<std::unique_ptr<KernelTask<T>>> tasks_;  // [shard]
  std::vector<std::uint32_t> all_;                     // numbers of all tasks
  mutable bool owes_copies_ = false;                   // what others own is as they had it before
  mutable std::vector<double> x_, v_;                  // [node] of a shard, in one lane
  std::unique_ptr<Crew> crew_;                         // the last: it ends first
};

}  // namespace ressort::kernels
