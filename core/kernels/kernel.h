// core/kernels: one way of stepping a Program, for as many voices at once as it has lanes.
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

// What a kernel is driven by and what it fills, for at most max_block_frames samples.
template <class T>
struct Block {
  std::size_t frames = 0;
  const T* value = nullptr;     // [frame][input][lane] position, or force
  const T* velocity = nullptr;  // [frame][input][lane] of a position, per sample
  bool is_common = false;       // both are [frame][input], for all lanes
  const T* audio = nullptr;     // [frame][audio coefficient][lane]
  T* outputs = nullptr;         // [frame][output][lane]
  // Nobody plays in lanes beyond so many: they may be left where they are.
  std::size_t lanes = std::numeric_limits<std::size_t>::max();
};

// The coefficients of a kernel's voices, and how they move: all that are on their way arrive
// after the same number of samples.
template <class T>
class Coefficients {
 public:
  Coefficients(const Program& program, std::size_t width);

  // At once, or to be reached by the next ramp(). [audio] wait-free
  void set(std::size_t lane, std::uint32_t c, double value, bool ramped);
  void ramp(std::size_t frames);
  // One lane as it is in another kernel of the same Program, ramps and all.
  void go_on(std::size_t lane, const Coefficients& from, std::size_t from_lane);
  // What a block of samples did to the ramps; values are kept by who steps them.
  void finish(std::size_t frames);

  std::size_t width;
  Aligned<T> value;                    // [coefficient][lane]
  Aligned<T> increment;                // [coefficient][lane] per sample, while ramping
  Aligned<T> target;                   // [coefficient][lane] where the ramp ends
  std::vector<std::uint32_t> ramping;  // those that move; at most all of them
  std::vector<bool> is_ramping;        // [coefficient]
  std::size_t ramp_frames = 0;         // how many samples they still move
};

// The same for code that is compiled for several instruction sets. One sample's step:
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

// How much of a kernel's work is being done.
struct Awake {
  std::size_t modes = 0;
  std::size_t of = 0;  // 0: it has no modes
};

// What look() does where every node has a position.
template <class Position>
std::size_t look_at(std::span<const std::uint32_t> nodes, std::span<double> numbers,
                    Position&& position) {
  if (numbers.size() < nodes.size()) {
    return 0;
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    numbers[i] = position(nodes[i]);
  }
  return nodes.size();
}

// The Program outlives its kernels and is shared by them. Nothing here throws or allocates after
// construction.
template <class T>
class Kernel {
 public:
  Kernel(const Program& program, std::size_t width)
      : coefficients(program, width), start_(program) {}
  virtual ~Kernel() = default;
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

  std::size_t width() const { return coefficients.width; }
  // Whether Block::is_common may be set where there are several lanes.
  virtual bool takes_common_inputs() const { return false; }

  // Puts one lane to positions and velocities, [node]; its coefficients stay. Nothing pulls in the
  // next sample. [audio]
  virtual void set_state(std::size_t lane, const double* x, const double* v) = 0;
  // After it: nor do passive links hold anything in that sample, which only leads to where another
  // kernel was. [audio]
  virtual void let_go(std::size_t) {}
  // The same, to where the model starts.
  void reset(std::size_t lane) { set_state(lane, start_.position.data(), start_.velocity.data()); }
  // Where every node is after the last sample, and how fast; false where the kernel does not know
  // of all. [audio]
  virtual bool save(std::size_t lane, double* x, double* v) const = 0;
  // The same of some nodes, [i][lane], as the numbers that they are. [audio]
  virtual bool read(std::span<const std::uint32_t> nodes, T* x, T* v) const;
  // Moves some nodes between two blocks. In the next sample links pull as if these had come to be
  // there by themselves; nothing else is touched, not even the last bit. False where the kernel
  // knows of no single nodes. [audio]
  virtual bool write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v);
  // Makes nodes faster by `changes`, per sample, as a force on each in the next sample would:
  // masses, modes that ring, and places on waveguides. [audio] O(nodes * modes)
  virtual void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
                      std::span<const double> changes) = 0;
  // Becomes what `from` is, another kernel of the same Program, made for as many voices: the same
  // next samples, to the bit. False where a kernel cannot. [audio]
  virtual bool become(const Kernel&) { return false; }
  // Plays the block by the published scheme, v += F/M, x += v: masses, then position inputs, then
  // links; the outputs are the new positions. Forces given act in their own sample. [audio]
  void step(const Block<T>& block) {
    play(block);
    clear_wide_registers();
  }
  // Whether every mass of a lane is nearer than `bound` to where it starts. [audio]
  virtual bool is_near_start(std::size_t lane, double bound) const = 0;
  // For a picture: where some nodes are after the last sample, or of modes how far each has moved,
  // whatever the nodes. How many numbers that are; 0: there is no room. [audio] O(numbers)
  virtual std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                           std::span<double> numbers) const = 0;
  // The same of a waveguide: its displacement from its left end at as many points as there are
  // numbers, both ends among them, as its waves have it. 0 where there is none. [audio]
  // O(samples + numbers)
  virtual std::size_t look_along(std::size_t, std::size_t, std::span<double>) const { return 0; }
  virtual Awake awake() const { return {}; }  // [audio]

  Coefficients<T> coefficients;

 private:
  virtual void play(const Block<T>& block) = 0;

  const Program& start_;
};

// The kernel that the Program asks for (Program::form), with at least one lane and no more than
// `voices` need. The instruction set may be narrower than the machine's, never wider.
template <class T>
std::unique_ptr<Kernel<T>> make_kernel(const Program& program, std::size_t voices, Isa isa);

}  // namespace ressort::kernels
