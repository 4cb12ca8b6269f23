// core/kernels: a block of one kernel as a Task.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <span>

#include "core/kernels/domains/executor.h"
#include "core/kernels/kernel.h"

namespace ressort::kernels {

// What drives a kernel in a block and what it fills, as Block says.
template <class T>
struct BlockBuffers {
  Aligned<T> value;
  Aligned<T> velocity;
  Aligned<T> audio;
  Aligned<T> outputs;
};

// What else a shard's kernel is given and gives.
template <class T>
struct HaloBuffers {
  std::span<const std::uint32_t> copies;      // nodes that are written before the block...
  std::span<const std::uint32_t> given;       // ...and those that are read after it
  Aligned<T> copied_x, copied_v;              // [i][lane]
  Aligned<T> given_x, given_v;                // [i][lane]
  std::vector<Coefficients<T>> coefficients;  // that it has from this block on, or none
  bool has_copies = false;
  bool has_coefficients = false;
};

template <class T>
class KernelTask final : public Task {
 public:
  using Make = std::function<std::unique_ptr<Kernel<T>>()>;

  // `kernel`: where its owner keeps it, who finds another one there after run(). `make`: two more
  // of the same for work aside; null: helpers work where it is.
  KernelTask(std::unique_ptr<Kernel<T>>& kernel, BlockBuffers<T> buffers, HaloBuffers<T> halo,
             const Make& make);
  // Whether kernels of this form can do it aside. [any thread but audio]
  bool can_copy() const { return can_copy_; }

  // The caller's.
  std::size_t frames = 0;
  std::size_t lanes = std::numeric_limits<std::size_t>::max();  // of the kernel, that play
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
  // What one performance reads and writes: nobody else moves it meanwhile.
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
  Job job_;  // the helper's, while it is in it
  bool can_copy_ = false;
};

}  // namespace ressort::kernels
