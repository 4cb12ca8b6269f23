// core/kernels: one block of a kernel as a Task.
#pragma once

#include <functional>
#include <limits>
#include <memory>

#include "core/kernels/kernel.h"
#include "core/kernels/threads/executor.h"

namespace ressort::kernels {

// Inputs and outputs of a kernel for one block, as in Block.
template <class T>
struct BlockBuffers {
  Aligned<T> value;
  Aligned<T> velocity;
  Aligned<T> audio;
  Aligned<T> outputs;
};

template <class T>
class KernelTask final : public Task {
 public:
  using Make = std::function<std::unique_ptr<Kernel<T>>()>;

  // `kernel`: the owner's pointer, which may point to another kernel after run(). `make` makes two
  // spare kernels for work on copies; null: helpers work in place.
  KernelTask(std::unique_ptr<Kernel<T>>& kernel, BlockBuffers<T> buffers, const Make& make);
  // Returns whether kernels of this form can work on copies. [any thread but audio]
  bool can_copy() const { return can_copy_; }

  // Set by the caller.
  std::size_t frames = 0;
  std::size_t lanes = std::numeric_limits<std::size_t>::max();  // Playing lanes of the kernel.
  bool is_still = false;                                        // as in Block
  BlockBuffers<T> buffers;

  void perform() override;
  void offer() override;
  void perform_aside() override;
  void accept() override;
  void take_over() override;

 private:
  struct Place {
    std::unique_ptr<Kernel<T>> kernel;
    BlockBuffers<T> buffers;
  };
  // Data of one execution. No other thread accesses it meanwhile.
  struct Job {
    const Kernel<T>* from = nullptr;
    Kernel<T>* kernel = nullptr;
    Block<T> block;
  };
  Job job_in(Kernel<T>& kernel, BlockBuffers<T>& filled);
  static void perform(const Job& job);
  void swap_results(Place& place);

  std::unique_ptr<Kernel<T>>& kernel_;
  Place aside_;
  Place spare_;
  Job job_;  // Owned by the helper while it works.
  bool can_copy_ = false;
};

}  // namespace ressort::kernels
