// core/kernels: a large network stepped by several cores, one shard each (domain decomposition). In
// the explicit scheme nothing travels farther than one link per sample. A shard with copies of all
// nodes within slightly more than n links of its own can therefore take n samples alone, after
// which only the copies are wrong. They are then refreshed from their owners. A shard's own nodes
// are always exact, so the result equals that of the whole network.
#pragma once

#include "core/kernels/domains/kernel_task.h"
#include "core/kernels/domains/sharded_form.h"

namespace ressort::kernels {

// The source of a consecutive range of copies in the owner's `given` list.
struct ShardSource {
  std::uint32_t shard = 0;
  std::uint32_t first = 0;  // Index into its `given`.
  std::uint32_t count = 0;
};

// A Program with the coefficients of the whole. Fixed nodes are in every shard that touches them.
// Inputs and outputs have a row in each shard that uses them.
struct Shard {
  Program program;
  std::vector<std::uint32_t> nodes;    // [i] Nodes of the whole, ascending.
  std::vector<std::uint32_t> inputs;   // Inputs of the whole.
  std::vector<std::uint32_t> outputs;  // Outputs of the whole.
  std::vector<std::uint32_t> given;    // Own nodes that others copy.
  std::vector<std::uint32_t> copies;   // Nodes owned by others.
  std::vector<ShardSource> sources;    // Sources of all copies, in order.
};

template <class T>
class ShardedKernel final : public Kernel<T> {
 public:
  // The executor must outlive it. All shards' kernels have the same width.
  ShardedKernel(const Program& program, const Shards& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  void disable_links(std::size_t lane) override {
    for (const auto& kernel : kernels_) {
      kernel->disable_links(lane);
    }
  }
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
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
  std::vector<std::uint32_t> all_;                     // Indices of all tasks.
  mutable bool owes_copies_ = false;   // The copies are those of before the last block.
  mutable std::vector<double> x_, v_;  // [node] of a shard, in one lane.
  std::unique_ptr<Crew> crew_;         // Last member: it is destroyed first.
};

}  // namespace ressort::kernels
