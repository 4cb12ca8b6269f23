// core/kernels: one block of a kernel as a Task.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <span>

#include "core/kernels/domains/executor.h"
#include "core/kernels/kernel.h"

namespace ressort::kernels {

// Inputs and outputs of a kernel for one block, as in Block.
template <class T>
struct BlockBuffers {
  Aligned<T> value;
  Aligned<T> velocity;
  Aligned<T> audio;
  Aligned<T> outputs;
};

// Additional inputs and outputs of a shard's kernel.
template <class T>
struct HaloBuffers {
  std::span<const std::uint32_t> copies;      // Nodes that are written before the block.
  std::span<const std::uint32_t> given;       // Nodes that are read after the block.
  Aligned<T> copied_x, copied_v;              // [i][lane]
  Aligned<T> given_x, given_v;                // [i][lane]
  std::vector<Coefficients<T>> coefficients;  // New coefficients for this block, or none.
  bool has_copies = false;
  bool has_coefficients = false;
};

template <class T>
class KernelTask final : public Task {
 public:
  using Make = std::function<std::unique_ptr<Kernel<T>>()>;

  // `kernel`: the owner's pointer, which may point to another kernel after run(). `make` makes two
  // spare kernels for work on copies; null: helpers work in place.
  KernelTask(std::unique_ptr<Kernel<T>>& kernel, BlockBuffers<T> buffers, HaloBuffers<T> halo,
             const Make& make);
  // Returns whether kernels of this form can work on copies. [any thread but audio]
  bool can_copy() const { return can_copy_; }

  // Set by the caller.
  std::size_t frames = 0;
  std::size_t lanes = std::numeric_limits<std::size_t>::max();  // Playing lanes of the kernel.
  BlockBuffers<T> buffers;
  HaloBuffers<T> halo;

  void perform() override;
  void offer() override;
  void perform_aside() override;
  void accept() override;
  void take_over() override;

 private:
  struct Place {
    std::unique_ptr<Kernel<T>> kernel;
    BlockBuffers<T> buffers;
    HaloBuffers<T> halo;
  };
  // Data of one execution. No other thread accesses it meanwhile.
  struct Job {
    const Kernel<T>* from = nullptr;
    Kernel<T>* kernel = nullptr;
    Block<T> block;
    const HaloBuffers<T>* in = nullptr;
    std::span<const std::uint32_t> copies, given;
    const T* copied_x = nullptr;
    const T* copied_v = nullptr;
    T* given_x = nullptr;
    T* given_v = nullptr;
    const Coefficients<T>* coefficients = nullptr;
  };
  Job job_in(Kernel<T>& kernel, BlockBuffers<T>& filled, HaloBuffers<T>& given);
  static void perform(const Job& job);
  void swap_results(Place& place);

  std::unique_ptr<Kernel<T>>& kernel_;
  Place aside_;
  Place spare_;
  Job job_;  // Owned by the helper while it works.
  bool can_copy_ = false;
};

}  // namespace ressort::kernels
