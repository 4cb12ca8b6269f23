#include "core/kernels/domains/kernel_task.h"

#include <utility>

namespace ressort::kernels {

template <class T>
KernelTask<T>::KernelTask(std::unique_ptr<Kernel<T>>& kernel, BlockBuffers<T> buffers_in,
                          HaloBuffers<T> halo_in, const Make& make)
    : buffers(std::move(buffers_in)), halo(std::move(halo_in)), kernel_(kernel) {
  if (make) {
    for (Place* const place : {&aside_, &spare_}) {
      *place = {make(), buffers, halo};
      for (Coefficients<T>& coefficients : place->halo.coefficients) {
        coefficients.ramping.reserve(coefficients.is_ramping.size());
      }
      can_copy_ = place->kernel->copy_from(*kernel_);
    }
  }
}

template <class T>
typename KernelTask<T>::Job KernelTask<T>::job_in(Kernel<T>& kernel, BlockBuffers<T>& filled,
                                                  HaloBuffers<T>& given) {
  return {.from = kernel_.get(),
          .kernel = &kernel,
          .block = {.frames = frames,
                    .value = buffers.value.data(),
                    .velocity = buffers.velocity.data(),
                    .audio = buffers.audio.data(),
                    .outputs = filled.outputs.data(),
                    .lanes = lanes},
          .copies = halo.has_copies ? halo.copies : std::span<const std::uint32_t>(),
          .given = halo.given,
          .copied_x = halo.copied_x.data(),
          .copied_v = halo.copied_v.data(),
          .given_x = given.given_x.data(),
          .given_v = given.given_v.data(),
          .coefficients = halo.has_coefficients ? halo.coefficients.data() : nullptr};
}

template <class T>
void KernelTask<T>::perform(const Job& job) {
  if (job.from != job.kernel) {
    job.kernel->copy_from(*job.from);
  }
  if (!job.copies.empty()) {
    job.kernel->write_nodes(job.copies, job.copied_x, job.copied_v);
  }
  if (job.coefficients != nullptr) {
    job.kernel->coefficients = *job.coefficients;
  }
  job.kernel->step(job.block);
  if (!job.given.empty()) {
    job.kernel->read(job.given, job.given_x, job.given_v);
  }
}

template <class T>
void KernelTask<T>::perform() {
  perform(job_in(*kernel_, buffers, halo));
}

template <class T>
void KernelTask<T>::offer() {
  job_ = job_in(*aside_.kernel, aside_.buffers, aside_.halo);
}

template <class T>
void KernelTask<T>::perform_aside() {
  perform(job_);
}

template <class T>
void KernelTask<T>::swap_results(Place& place) {
  std::swap(kernel_, place.kernel);
  std::swap(buffers.outputs, place.buffers.outputs);
  std::swap(halo.given_x, place.halo.given_x);
  std::swap(halo.given_v, place.halo.given_v);
}

template <class T>
void KernelTask<T>::accept() {
  swap_results(aside_);
}

// The late helper keeps reading its input, so no other thread may write that until the helper
// returns. The spare copy becomes the current one, with the same inputs.
template <class T>
void KernelTask<T>::take_over() {
  perform(job_in(*spare_.kernel, spare_.buffers, spare_.halo));
  swap_results(spare_);
  const auto go_on_with = [](Aligned<T>& mine, Aligned<T>& other) {
    other = mine;
    std::swap(mine, other);
  };
  go_on_with(buffers.value, spare_.buffers.value);
  go_on_with(buffers.velocity, spare_.buffers.velocity);
  go_on_with(buffers.audio, spare_.buffers.audio);
  go_on_with(halo.copied_x, spare_.halo.copied_x);
  go_on_with(halo.copied_v, spare_.halo.copied_v);
  spare_.halo.coefficients = halo.coefficients;
  std::swap(halo.coefficients, spare_.halo.coefficients);
}

template class KernelTask<float>;
template class KernelTask<double>;

}  // namespace ressort::kernels
