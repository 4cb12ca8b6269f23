// core/kernels: the interface of a kernel, which steps a Program for several voices, one per lane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "core/lanes.h"

namespace ressort::kernels {

inline constexpr std::size_t max_block_frames = 64;

// The inputs and outputs of a kernel for at most max_block_frames samples.
template <class T>
struct Block {
  std::size_t frames = 0;
  const T* value = nullptr;     // [frame][input][lane] position, or force
  const T* velocity = nullptr;  // [frame][input][lane] of a position, per sample
  bool is_common = false;       // both are [frame][input], for all lanes
  bool is_still = false;        // all frames have the values of the first
  const T* audio = nullptr;     // [frame][audio coefficient][lane]
  T* outputs = nullptr;         // [frame][output][lane]
  // Lanes from this number on have no voice; the kernel may skip them.
  std::size_t lanes = std::numeric_limits<std::size_t>::max();
};

// The coefficients of a kernel's voices, with linear ramps. All ramps end after the same number of
// samples.
template <class T>
class Coefficients {
 public:
  Coefficients(const Program& program, std::size_t width);

  // Sets a value at once, or the target of the next ramp(). [audio] wait-free
  void set(std::size_t lane, std::uint32_t c, double value, bool ramped);
  void ramp(std::size_t frames);
  // Copies one lane, including its ramps, from another kernel of the same Program.
  void copy_lane(std::size_t lane, const Coefficients& from, std::size_t from_lane);
  // Ends the ramps that a block of `frames` samples has completed. The kernel updates the values.
  void finish(std::size_t frames);

  std::size_t width;
  Aligned<T> value;                    // [coefficient][lane]
  Aligned<T> increment;                // [coefficient][lane] per sample; 0 if it does not ramp
  Aligned<T> target;                   // [coefficient][lane] at the end of the ramp, or the value
  std::vector<std::uint32_t> ramping;  // coefficients that are ramping
  std::vector<bool> is_ramping;        // [coefficient]
  std::size_t ramp_frames = 0;         // samples until the ramps end
  bool has_changed = true;             // since a kernel that needs to know has cleared it
};

// The ramps as plain pointers, for loops that are compiled once for each instruction set.
template <class T>
struct Ramps {
  T* value;
  const T* increment;
  const T* target;
  const std::uint32_t* ramping;
  std::size_t count;
  std::size_t width;
  std::size_t frames;
};
template <class T>
Ramps<T> ramps_of(Coefficients<T>& coefficients) {
  return {coefficients.value.data(),   coefficients.increment.data(), coefficients.target.data(),
          coefficients.ramping.data(), coefficients.ramping.size(),   coefficients.width,
          coefficients.ramp_frames};
}
// Advances all ramps by one sample.
template <class T>
static inline void advance(Ramps<T>& ramps) {
  if (ramps.frames == 0) {
    return;
  }
  const auto set = [&](auto&& value_of) __attribute__((always_inline)) {
    for (std::size_t i = 0; i < ramps.count; ++i) {
      const std::size_t first = ramps.ramping[i] * ramps.width;
      for (std::size_t c = first; c < first + ramps.width; ++c) {
        ramps.value[c] = value_of(c);
      }
    }
  };
  if (--ramps.frames > 0) {
    set([&](std::size_t c) { return ramps.value[c] + ramps.increment[c]; });
  } else {
    set([&](std::size_t c) { return ramps.target[c]; });
  }
}

// The number of modes that a kernel steps, and of modes that it has.
struct Awake {
  std::size_t modes = 0;
  std::size_t of = 0;  // 0 if the kernel has no modes
};

// Implements read_positions() for kernels that keep a position of every node.
template <class Position>
std::size_t copy_positions(std::span<const std::uint32_t> nodes, std::span<double> numbers,
                           Position&& position) {
  if (numbers.size() < nodes.size()) {
    return 0;
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    numbers[i] = position(nodes[i]);
  }
  return nodes.size();
}

// The pitch of a voice, by which a kernel may choose its steps.
struct VoicePitch {
  double warp = 0.0;    // factor on the stiffness that keeps it in tune at one step; 0: not known
  double share = 1.0;   // of the highest stiffness factor at which the Program is stable
  bool is_new = false;  // reset() follows
};

// Steps a Program. Kernels share the Program, which outlives them. No function throws or allocates
// after construction.
template <class T>
class Kernel {
 public:
  Kernel(const Program& program, std::size_t width)
      : coefficients(program, width), start_(program) {}
  virtual ~Kernel() = default;
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

  std::size_t width() const { return coefficients.width; }
  // Returns whether Block::is_common may be set for a kernel of several lanes.
  virtual bool takes_common_inputs() const { return false; }

  // Sets the positions and velocities of one lane, [node]. Its coefficients stay. Links exert no
  // force in the next sample. [audio]
  virtual void set_state(std::size_t lane, const double* x, const double* v) = 0;
  // Disables passive links in the sample after set_state(), too: that sample only reproduces the
  // state of another kernel. [audio]
  virtual void disable_links(std::size_t) {}
  // Tells the pitch of a voice before its coefficients are set. [audio]
  virtual void tune(std::size_t, const VoicePitch&) {}
  // Sets one lane to the initial state of the model.
  void reset(std::size_t lane) { set_state(lane, start_.position.data(), start_.velocity.data()); }
  // Copies the position and velocity of every node after the last sample. Returns false if the
  // kernel does not have all of them. [audio]
  virtual bool save(std::size_t lane, double* x, double* v) const = 0;
  // Copies those of some nodes, [i][lane], without conversion. [audio]
  virtual bool read(std::span<const std::uint32_t> nodes, T* x, T* v) const;
  // Adds `changes` to the velocities of nodes (masses, modes of bodies, places on waveguides), as a
  // force on each of them in the next sample would. [audio] O(nodes * modes)
  virtual void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
                      std::span<const double> changes) = 0;
  // Copies the state of another kernel of the same Program and the same number of voices. The next
  // samples are the same to the bit. Returns false if the kernel does not support this. [audio]
  virtual bool copy_from(const Kernel&) { return false; }
  // Computes a block by the published scheme, symplectic Euler: v += F/M, x += v. In each sample
  // masses move first, then position inputs, then the links compute their forces for the next
  // sample. The outputs are the new positions. Input forces act in their own sample. [audio]
  void step(const Block<T>& block) {
    play(block);
    clear_wide_registers();
  }
  // Returns whether every mass of a lane is nearer than `bound` to its initial position. [audio]
  virtual bool is_near_start(std::size_t lane, double bound) const = 0;
  // Copies, for a picture, the positions of some nodes after the last sample. A modal kernel copies
  // the displacements of all modes instead. Returns the count of numbers; 0 if `numbers` is too
  // small. [audio] O(numbers)
  virtual std::size_t read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                                     std::span<double> numbers) const = 0;
  // Copies the displacement of a waveguide at equally spaced points from its left to its right end.
  // Returns 0 if there is no such waveguide. [audio] O(samples + numbers)
  virtual std::size_t read_waveguide(std::size_t, std::size_t, std::span<double>) const {
    return 0;
  }
  virtual Awake awake() const { return {}; }  // [audio]

  Coefficients<T> coefficients;

 private:
  virtual void play(const Block<T>& block) = 0;

  const Program& start_;
};

// Makes the kernel of Program::form, with at least one lane and no more lanes than `voices` need.
// The instruction set must be one that the machine has.
template <class T>
std::unique_ptr<Kernel<T>> make_kernel(const Program& program, std::size_t voices, Isa isa);

}  // namespace ressort::kernels
