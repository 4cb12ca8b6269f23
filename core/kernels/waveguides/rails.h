// core/kernels: the waves on a Program's waveguides. Both of a waveguide's rails are one ring of
// velocities, since an end that is held or free gives back what comes, with a sign that the ring
// leaves out. Once on its way round, a wave passes the allpass and the loss: anywhere, as far as
// the tone goes; so they are where nothing holds on to the string (core/compile/machine.cpp), and
// its sounding length is exact there, not just to a sample.
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

namespace ressort {

inline constexpr double lowest_waveguide_hz = 15.0;  // that rings have room for
inline constexpr int waveguide_fade_frames = 64;     // from one length, or place, to another

// How many samples a loop needs at least, if there are so many places: each has one of its own.
constexpr std::uint32_t least_waveguide_samples(std::uint32_t places) {
  return 2 * (places + 1);
}

// Of each ring: a power of two.
std::uint32_t waveguide_slots(const Program& program);

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
  };

  std::size_t width;
  std::uint32_t now = 0;  // where all rings are written, before the mask
  std::vector<Guide> guides;
  Aligned<T> ring;  // [guide][slot][lane]
  // [guide][lane]: the samples in the ring, and the filters.
  std::vector<std::uint32_t> end, next_end;
  Aligned<T> allpass, pole, gain, next_allpass, next_pole, next_gain;
  Aligned<T> allpass_state, pole_state;
  // [place][lane]: delays at which the waves pass it.
  std::vector<std::uint32_t> right, left, next_right, next_left;
  Aligned<T> unforced;  // [place][lane] the change of position if nothing pulls

 private:
  bool is_new(const Guide& guide, std::size_t lane, const T* coefficients) const;
  void design(Guide& guide, std::size_t lane, const T* coefficients);
  void settle(Guide& guide, std::size_t lane);

  const Program& program_;
  std::vector<T> designed_;  // [guide: frequency, T60, brightness; then places][lane]
  std::vector<double> u_;    // of a guide's places
  std::vector<std::uint32_t> order_, delays_;  // [place, 2] of them
};

// The same in packs, for the loops. `s` is a view of the nodes: V* v, force, coefficient, and
// move(node).
template <class V, class T>
struct RailLoops {
  static constexpr std::size_t lanes = sizeof(V) / sizeof(T);
  using Guide = typename Rails<T>::Guide;

  static V read(const Rails<T>& rails, const Guide& guide, const std::uint32_t* delay) {
    const T* const ring = rails.ring.data() + guide.ring;
    V wave;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      wave[lane] = ring[((rails.now - delay[lane]) & guide.mask) * lanes + lane];
    }
    return wave;
  }
  static void add(Rails<T>& rails, const Guide& guide, const std::uint32_t* delay, V more) {
    T* const ring = rails.ring.data() + guide.ring;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      ring[((rails.now - delay[lane]) & guide.mask) * lanes + lane] += more[lane];
    }
  }
  // How much of the next numbers counts already.
  static T share_of_next(const Guide& guide) {
    return T(1) - static_cast<T>(guide.fading) / static_cast<T>(waveguide_fade_frames);
  }
  static V sign_of_left(const Guide& guide) { return V{} + (guide.slot->is_open ? T(1) : T(-1)); }

  // Where every place would be at the sample's end, with what already pulls at it.
  template <class S>
  static void move_places(const Program& program, Rails<T>& rails, S& s) {
    for (const Guide& guide : rails.guides) {
      const V sign = sign_of_left(guide);
      for (std::uint32_t i = 0; i < guide.slot->count; ++i) {
        const JunctionSlot& place = program.junctions[guide.slot->first + i];
        const std::size_t at = guide.place_row + i * lanes;
        V in = read(rails, guide, &rails.right[at]) + sign * read(rails, guide, &rails.left[at]);
        if (guide.fading > 0) {
          const V next = read(rails, guide, &rails.next_right[at]) +
                         sign * read(rails, guide, &rails.next_left[at]);
          in += share_of_next(guide) * (next - in);
        }
        const V unforced = 2 * in - s.v[place.node];
        store<V>(&rails.unforced[at], unforced);
        s.v[place.node] =
            unforced + s.force[place.node] * s.coefficient[guide.slot->inverse_impedance];
        s.move(place.node);
        s.force[place.node] = V{};
      }
    }
  }

  // Once all forces are known: what they did to the places goes into the waves, and all goes on.
  template <class S>
  static void go_on(const Program& program, Rails<T>& rails, const S& s) {
    for (Guide& guide : rails.guides) {
      const V sign = sign_of_left(guide);
      for (std::uint32_t i = 0; i < guide.slot->count; ++i) {
        const std::size_t at = guide.place_row + i * lanes;
        const std::uint32_t node = program.junctions[guide.slot->first + i].node;
        V wave = (s.v[node] - load<V>(&rails.unforced[at])) / 2;
        if (!any_of(wave != V{})) {
          continue;  // nothing pulls where it is only heard
        }
        if (guide.fading > 0) {
          const V later = share_of_next(guide) * wave;
          add(rails, guide, &rails.next_right[at], later);
          add(rails, guide, &rails.next_left[at], sign * later);
          wave -= later;
        }
        add(rails, guide, &rails.right[at], wave);
        add(rails, guide, &rails.left[at], sign * wave);
      }
      reflect(rails, guide);
    }
    ++rails.now;
  }

 private:
  // What comes to the filters and what goes on from there.
  static void reflect(Rails<T>& rails, Guide& guide) {
    const std::size_t row = guide.row;
    V wave = read(rails, guide, &rails.end[row]);
    V c = load<V>(&rails.allpass[row]);
    V a = load<V>(&rails.pole[row]);
    V g = load<V>(&rails.gain[row]);
    if (guide.fading > 0) {
      const T share = share_of_next(guide);
      wave += share * (read(rails, guide, &rails.next_end[row]) - wave);
      c += share * (load<V>(&rails.next_allpass[row]) - c);
      a += share * (load<V>(&rails.next_pole[row]) - a);
      g += share * (load<V>(&rails.next_gain[row]) - g);
      if (--guide.fading == 0) {
        arrive(rails, guide);
      }
    }
    const V lost = (1 - a) * wave + a * load<V>(&rails.pole_state[row]);
    store<V>(&rails.pole_state[row], lost);
    const V in = g * lost;
    const V out = c * in + load<V>(&rails.allpass_state[row]);
    store<V>(&rails.allpass_state[row], in - c * out);
    store<V>(&rails.ring[guide.ring + (rails.now & guide.mask) * lanes], out);
  }

  static void arrive(Rails<T>& rails, const Guide& guide) {
    for (std::size_t i = guide.row; i < guide.row + lanes; ++i) {
      rails.end[i] = rails.next_end[i];
      rails.allpass[i] = rails.next_allpass[i];
      rails.pole[i] = rails.next_pole[i];
      rails.gain[i] = rails.next_gain[i];
    }
    for (std::size_t i = guide.place_row; i < guide.place_row + guide.slot->count * lanes; ++i) {
      rails.right[i] = rails.next_right[i];
      rails.left[i] = rails.next_left[i];
    }
  }
};

}  // namespace ressort
