// core/kernels: what moves so slowly that a few points of it say it all, such as an LFO. It is
// stepped to fourth order once in D samples, two steps ahead, and between the steps a cubic goes
// through the four that are around. One voice.
//
// What comes in acts with the next coarse step, which is up to 2 D samples later; what is wanted
// sooner must not be played this way. After set_state() the first D samples are stepped one by one:
// where the coarse steps begin, and how fast, is known from them.
#pragma once

#include "core/kernels/kernel.h"

namespace ressort::kernels {

template <class T>
class SlowKernel final : public Kernel<T> {
 public:
  // The form's Programs outlive it.
  SlowKernel(const Program& program, const Slow& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) override;
  bool is_near_start(std::size_t lane, double bound) const override;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const override;

 private:
  static constexpr std::size_t points = 4;

  // One of the two kernels, and what drives it; its first lane is the voice.
  struct Stepper {
    Stepper(const Program& program, Isa isa);
    // What the voice's coefficients are in its kernel, each times a factor.
    void take(const Coefficients<T>& coefficients, const std::vector<T>& factor);
    void step(const Coefficients<T>& coefficients, const std::vector<T>& factor);

    const Program& program;
    std::unique_ptr<Kernel<T>> kernel;
    Aligned<T> value, velocity, outputs;  // as Block says, of one frame
  };

  void play(const Block<T>& block) override;
  void step_fine(const T* value, const T* velocity);
  void step_coarse();
  void start_coarse();
  void gather(const T* value);
  double interpolated(std::size_t node, std::size_t sample) const;

  const Program& program_;
  std::size_t frames_;
  Stepper fine_;
  Stepper coarse_;
  std::vector<T> same_;         // [coefficient] factor from a sample to a sample
  std::vector<T> factor_;       // [coefficient] to a coarse step
  std::vector<double> weight_;  // [sample of a step, 0..frames][point]
  bool is_fine_ = true;
  std::size_t since_ = 0;            // samples, since set_state() or the last coarse step
  std::vector<double> rows_;         // [point][node] positions: one step ago, here, and two ahead
  std::vector<double> x_, v_, aim_;  // [node]
  std::vector<T> pushed_;            // [input] forces summed up, or where the hand is
};

}  // namespace ressort::kernels
