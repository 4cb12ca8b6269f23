// core/kernels: a Program stepped several times per sample by another kernel, at a finer rate.
// Input forces are held for the whole sample and position inputs are interpolated linearly. The
// output is the position after the last step, without a decimation filter: nothing may oscillate
// above half the coarse rate.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/oversampled/oversampled_form.h"

namespace ressort::kernels {

template <class T>
class OversampledKernel final : public Kernel<T> {
 public:
  // The form's Program outlives it.
  OversampledKernel(const Program& program, const Oversampled& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                             std::span<double> numbers) const override;
  Awake awake() const override { return fine_->awake(); }

 private:
  OversampledKernel(const Program& program, const Oversampled& form,
                    std::unique_ptr<Kernel<T>> fine);
  void play(const Block<T>& block) override;
  void refine_coefficients();
  void step_finely(const T* value, const T* velocity, const T* audio);

  const Program& program_;
  std::size_t times_;
  std::unique_ptr<Kernel<T>> fine_;
  std::vector<T> factor_;        // [coefficient] factor from a sample to a step
  Aligned<T> value_, velocity_;  // [step][input][lane]
  Aligned<T> audio_;             // [step][audio coefficient][lane]
  Aligned<T> outputs_;           // [step][output][lane]
  std::vector<double> speed_;    // [node]
};

}  // namespace ressort::kernels
