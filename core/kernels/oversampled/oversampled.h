// core/kernels: a Program stepped several times per sample by another kernel, at a finer rate.
// Input forces are held for the whole sample and position inputs are interpolated linearly. The
// output is the position after the last step, without a decimation filter: nothing may oscillate
// above half the coarse rate.
//
// A form with a coarse Program takes several steps for the sake of high keys. A voice whose
// stiffness is stable at one step a sample takes one, from its start until it is bent beyond that.
// Its stiffness is multiplied by VoicePitch::warp, because one step of symplectic Euler plays a
// mode higher than several do.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/oversampled/oversampled_form.h"

namespace ressort::kernels {

template <class T>
class OversampledKernel final : public Kernel<T> {
 public:
  // The form's Program outlives it.
  OversampledKernel(const Program& program, const Oversampled& form, std::size_t voices, Isa isa);
  void tune(std::size_t lane, const VoicePitch& pitch) override;
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
                    std::unique_ptr<Kernel<T>> fine, std::unique_ptr<Kernel<T>> coarse);
  bool is_coarse(std::size_t lane) const { return warp_[lane] > T(0); }
  Kernel<T>& of(std::size_t lane) const { return is_coarse(lane) ? *coarse_ : *fine_; }
  double steps_of(std::size_t lane) const {
    return is_coarse(lane) ? 1.0 : static_cast<double>(times_);
  }
  void play(const Block<T>& block) override;
  void refine_coefficients();
  void step_finely(const T* value, const T* velocity, const T* audio);

  const Program& program_;
  std::size_t times_;
  std::unique_ptr<Kernel<T>> fine_;
  std::unique_ptr<Kernel<T>> coarse_;  // null: all voices take all steps
  std::vector<T> warp_;                // [lane] factor on the stiffness of a coarse voice; 0: fine
  std::vector<T> factor_;              // [coefficient] factor from a sample to a step
  std::vector<bool> is_stiffness_;     // [coefficient]
  Aligned<T> value_, velocity_;        // [step][input][lane]
  Aligned<T> audio_;                   // [step][audio coefficient][lane]
  Aligned<T> outputs_;                 // [step][output][lane]
  std::vector<double> position_;       // [node]
  std::vector<double> speed_;
};

}  // namespace ressort::kernels
