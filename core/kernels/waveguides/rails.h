// core/kernels: the waves on a Program's waveguides. Both of a waveguide's rails are one ring of
// velocities, since an end that is held or free gives back what comes, with a sign that the ring
// leaves out. Once on its way round, a wave passes the allpass and the loss: anywhere, as far as
// the tone goes; so they are where nothing holds on to the string (core/compile/machine.cpp), and
// its sounding length is exact there, not just to a sample.
//
// What comes to a place within fewer samples than lie between it and the nearest other one does not
// hang on what happens meanwhile. So a run of samples is read at once, the filters' too; what
// forces did to the waves is added to them at the run's end. The bits are those of sample by
// sample.
//
// A place sees the wave that runs right, r, and that which runs left, l. With a force f on it, 1/R
// being the inverse of the impedance,
//
//   v = r + l + f/2R,  r and l grow by f/2R,  x[n+1] = x[n-1] + 2 v
//
// That is a node that was at x[n-1], would go to x[n-1] + 2 (r + l) and gives way by 1/R to a force
// of 1: a link sees it as it sees a mass (core/laws/discrete_gradient.h). The waves gain f v then,
// which is exactly the force's work f (x[n+1] - x[n-1])/2.
#pragma once

#include <vector>

#include "core/kernels/kernel.h"
#include "core/kernels/waveguides/design.h"
#include "core/lanes.h"

namespace ressort::kernels {

inline constexpr double lowest_waveguide_hz = 15.0;  // that rings have room for
inline constexpr int waveguide_fade_frames = 64;     // from one length, or place, to another
inline constexpr std::uint32_t waveguide_run = 16;   // samples that are read at once, at most

// How many samples a loop needs at least, if there are so many places: each has one of its own.
constexpr std::uint32_t least_waveguide_samples(std::uint32_t places) {
  return 2 * (places + 1);
}

// Of each ring: a power of two.
std::uint32_t waveguide_slots(const Program& program);
// ...and how many of them a loop may have: a run of samples is written ahead.
std::uint32_t most_waveguide_samples(const Program& program);

template <class T>
class Rails {
 public:
  Rails(const Program& program, std::size_t width);

  bool is_empty() const { return guides.empty(); }
  // No waves; the lane is designed anew before it sounds. [audio]
  void clear(std::size_t lane);
  // Before a block: what has changed its numbers since is designed anew, and faded to. [audio]
  void prepare(const T* coefficients);
  // Whether no wave of a lane is faster than that. O(samples) [audio]
  bool is_quiet(std::size_t lane, double bound) const;
  // Its displacement from the left end, at so many points as there are numbers: of the sum of what
  // runs left less what runs right, sample by sample. The filters' own delay is spread over all of
  // it. How many numbers that are. O(samples + numbers) [audio]
  std::size_t look(std::size_t lane, std::size_t guide, std::span<double> numbers) const;
  // What the waves of a lane hold, with the impedances as they are; fades apart.
  double energy(std::size_t lane, const T* coefficients) const;

  struct Guide {
    const WaveguideSlot* slot;
    std::size_t ring;       // of its first number in `ring`
    std::uint32_t mask;     // slots - 1
    std::size_t row;        // of its numbers in those below, [guide][lane]
    std::size_t place_row;  // the same of its places, [place][lane]
    int fading;             // frames left
    std::uint32_t run;      // how many samples may be read at once
    bool is_run_known;      // ...and are no longer held down by a fade that has ended
  };

  // Where a lane has the wave of a slot, before the mask.
  T* wave(const Guide& guide, std::size_t lane, std::uint32_t slot) {
    return ring.data() + guide.ring + lane * stride + (slot & guide.mask);
  }
  const T* wave(const Guide& guide, std::size_t lane, std::uint32_t slot) const {
    return ring.data() + guide.ring + lane * stride + (slot & guide.mask);
  }

  std::size_t width;
  std::size_t stride;     // of a lane in a ring: slots, and a cache line that keeps lanes apart
  std::uint32_t now = 0;  // where all rings are written, before the mask; of the run's first sample
  std::uint32_t run = 0;  // samples that are read, of which `done` are played
  std::uint32_t done = 0;
  std::vector<Guide> guides;
  Aligned<T> ring;  // [guide][lane][slot]
  // [guide][lane]: the samples in the ring, and the filters.
  std::vector<std::uint32_t> end, next_end;
  Aligned<T> allpass, pole, gain, next_allpass, next_pole, next_gain;
  Aligned<T> allpass_state, pole_state;
  // [place][lane]: delays at which the waves pass it.
  std::vector<std::uint32_t> right, left, next_right, next_left;
  std::vector<std::uint32_t> gives;  // [place] coefficient: 1/R
  // [place][sample of the run][lane]: the waves that come, the right one and the left; what forces
  // do to them, and until that is known how far the place would move without.
  Aligned<T> comes, goes;

 private:
  bool is_new(const Guide& guide, std::size_t lane, const T* coefficients) const;
  void design(Guide& guide, std::size_t lane, const T* coefficients);
  void settle(Guide& guide, std::size_t lane);
  std::uint32_t longest_run(const Guide& guide, const T* coefficients);

  const Program& program_;
  std::vector<T> designed_;  // [guide: frequency, T60, brightness; then places][lane]
  std::vector<double> u_;    // of a guide's places
  std::vector<std::uint32_t> order_, delays_;  // [place, 2] of them
  std::vector<std::uint32_t> all_delays_;      // of a lane
};

}  // namespace ressort::kernels
