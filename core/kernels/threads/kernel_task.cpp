#include "core/kernels/threads/kernel_task.h"

#include <utility>

namespace ressort::kernels {

template <class T>
KernelTask<T>::KernelTask(std::unique_ptr<Kernel<T>>& kernel, BlockBuffers<T> buffers_in,
                          const Make& make)
    : buffers(std::move(buffers_in)), kernel_(kernel) {
  if (make) {
    for (Place* const place : {&aside_, &spare_}) {
      *place = {make(), buffers};
      can_copy_ = place->kernel->copy_from(*kernel_);
    }
  }
}

template <class T>
typename KernelTask<T>::Job KernelTask<T>::job_in(Kernel<T>& kernel, BlockBuffers<T>& filled) {
  return {.from = kernel_.get(),
          .kernel = &kernel,
          .block = {.frames = frames,
                    .value = buffers.value.data(),
                    .velocity = buffers.velocity.data(),
                    .is_still = is_still,
                    .audio = buffers.audio.data(),
                    .outputs = filled.outputs.data(),
                    .lanes = lanes}};
}

template <class T>
void KernelTask<T>::perform(const Job& job) {
  if (job.from != job.kernel) {
    job.kernel->copy_from(*job.from);
  }
  job.kernel->step(job.block);
}

template <class T>
void KernelTask<T>::perform() {
  perform(job_in(*kernel_, buffers));
}

template <class T>
void KernelTask<T>::offer() {
  job_ = job_in(*aside_.kernel, aside_.buffers);
}

template <class T>
void KernelTask<T>::perform_aside() {
  perform(job_);
}

template <class T>
void KernelTask<T>::swap_results(Place& place) {
  std::swap(kernel_, place.kernel);
  std::swap(buffers.outputs, place.buffers.outputs);
}

template <class T>
void KernelTask<T>::accept() {
  swap_results(aside_);
}

// The late helper keeps reading its input, so no other thread may write that until the helper
// returns. The spare copy becomes the current one, with the same inputs.
template <class T>
void KernelTask<T>::take_over() {
  perform(job_in(*spare_.kernel, spare_.buffers));
  swap_results(spare_);
  const auto go_on_with = [](Aligned<T>& mine, Aligned<T>& other) {
    other = mine;
    std::swap(mine, other);
  };
  go_on_with(buffers.value, spare_.buffers.value);
  go_on_with(buffers.velocity, spare_.buffers.velocity);
  go_on_with(buffers.audio, spare_.buffers.audio);
}

template class KernelTask<float>;
template class KernelTask<double>;

}  // namespace ressort::kernels
