// core/kernels: the waves on a Program's digital waveguides. Both rails of a waveguide share one
// ring of velocity waves, because a fixed or free end reflects the wave with a sign that the ring
// leaves out. Once per period a wave passes the allpass and the loss filter. Their position does
// not affect the tone, so they are placed where nothing is attached (core/compile/machine.cpp); the
// sounding length is exact there and not rounded to a sample.
//
// A wave that reaches a place sooner than one from the nearest other place cannot depend on what
// happens in between. So a run of samples, filters included, is read at once, and the effect of
// forces is added at the end of the run. The result has the same bits as sample-by-sample
// processing.
//
// A place sees the right-going wave r and the left-going wave l. With a force f on it and 1/R the
// inverse of the wave impedance,
//
//  v = r + l + f/2R,  r and l grow by f/2R,  x[n+1] = x[n-1] + 2 v
//
// This equals a node that was at x[n-1], would move to x[n-1] + 2 (r + l), and responds with 1/R to
// a unit force, so a link treats it like a mass (core/laws/discrete_gradient.h). The waves gain the
// energy f v, which is exactly the work of the force, f (x[n+1] - x[n-1])/2.
#pragma once

#include <vector>

#include "core/kernels/kernel.h"
#include "core/kernels/waveguides/design.h"
#include "core/lanes.h"

namespace ressort::kernels {

inline constexpr double lowest_waveguide_hz = 15.0;  // Lowest frequency that fits into a ring.
inline constexpr int waveguide_fade_frames = 64;     // Cross-fade between two lengths or places.
inline constexpr std::uint32_t waveguide_run = 16;   // Most samples read at once.

// Returns the least number of samples in a loop with so many places: each needs one of its own.
constexpr std::uint32_t least_waveguide_samples(std::uint32_t places) {
  return 2 * (places + 1);
}

// Returns the size of each ring, a power of two.
std::uint32_t waveguide_slots(const Program& program);
// Returns the most samples of a loop: a run is written ahead.
std::uint32_t most_waveguide_samples(const Program& program);

template <class T>
class Rails {
 public:
  Rails(const Program& program, std::size_t width);

  bool is_empty() const { return guides.empty(); }
  // Clears the waves; the lane is designed again before it sounds. [audio]
  void clear(std::size_t lane);
  // Before a block: redesigns waveguides whose numbers have changed, and starts a cross-fade.
  // [audio]
  void prepare(const T* coefficients);
  // Returns whether no wave of a lane exceeds the bound. O(samples) [audio]
  bool is_quiet(std::size_t lane, double bound) const;
  // Computes the displacement from the left end at equidistant points, by summing the left-going
  // minus the right-going waves. The filters' delay is distributed over the length. Returns the
  // number of points. O(samples + numbers) [audio]
  std::size_t read_positions(std::size_t lane, std::size_t guide, std::span<double> numbers) const;
  // Returns the energy of the waves in a lane for the current impedances, cross-fades excluded.
  double energy(std::size_t lane, const T* coefficients) const;

  struct Guide {
    const WaveguideSlot* slot;
    std::size_t ring;       // First number in `ring`.
    std::uint32_t mask;     // Number of slots - 1.
    std::size_t row;        // First number in the tables below: [guide][lane].
    std::size_t place_row;  // First number of its places: [place][lane].
    int fading;             // Frames left of a cross-fade.
    std::uint32_t run;      // Samples that may be read at once.
    bool is_run_known;      // True once a finished cross-fade no longer limits the run.
  };

  // Returns the address of a slot's wave in a lane; the mask is applied here.
  T* wave(const Guide& guide, std::size_t lane, std::uint32_t slot) {
    return ring.data() + guide.ring + lane * stride + (slot & guide.mask);
  }
  const T* wave(const Guide& guide, std::size_t lane, std::uint32_t slot) const {
    return ring.data() + guide.ring + lane * stride + (slot & guide.mask);
  }

  std::size_t width;
  // Distance between lanes in a ring: the slots, plus a cache line that keeps lanes apart.
  std::size_t stride;
  std::uint32_t now = 0;  // Write position of all rings, unmasked, at the run's first sample.
  std::uint32_t run = 0;  // Samples read in this run, of which `done` have been played.
  std::uint32_t done = 0;
  std::vector<Guide> guides;
  Aligned<T> ring;  // [guide][lane][slot]
  // [guide][lane] Samples in the ring, and the filter coefficients.
  std::vector<std::uint32_t> end, next_end;
  Aligned<T> allpass, pole, gain, next_allpass, next_pole, next_gain;
  Aligned<T> allpass_state, pole_state;
  // [place][lane] Delays at which the waves pass the place.
  std::vector<std::uint32_t> right, left, next_right, next_left;
  std::vector<std::uint32_t> gives;  // [place] Coefficient 1/R.
  // [place][sample of the run][lane] `comes`: the arriving waves, right and left. `goes`: the
  // effect of forces, and before that is known, the motion without forces.
  Aligned<T> comes, goes;

 private:
  bool is_new(const Guide& guide, std::size_t lane, const T* coefficients) const;
  void design(Guide& guide, std::size_t lane, const T* coefficients);
  void jump_to_design(Guide& guide, std::size_t lane);
  std::uint32_t longest_run(const Guide& guide, const T* coefficients);

  const Program& program_;
  std::vector<T> designed_;  // [guide: frequency, T60, brightness; then places][lane]
  std::vector<double> u_;    // Coordinates of a guide's places.
  std::vector<std::uint32_t> order_, delays_;  // [place, 2] Order and delays.
  std::vector<std::uint32_t> all_delays_;      // Delays of one lane.
};

}  // namespace ressort::kernels
