// core/kernels: processes waves on waveguides in packs: a run of samples is read, played and
// written. Included by *_step.cpp, which are compiled for each instruction set.
#pragma once

#include <algorithm>

#include "core/kernels/waveguides/rails.h"
#include "core/kernels/waveguides/transpose.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// `s` is a view of the nodes: V* v, force, coefficient, and shift(node, way).
template <class V, class T>
struct RailLoops {
  static constexpr std::size_t lanes = sizeof(V) / sizeof(T);
  using Guide = typename Rails<T>::Guide;
  using Run = V[waveguide_run];

  // Reads the waves that reach the places in the next samples, at most `left`.
  static void read_run(Rails<T>& rails, std::size_t left) {
    rails.run = static_cast<std::uint32_t>(std::min<std::size_t>(left, waveguide_run));
    for (const Guide& guide : rails.guides) {
      rails.run = std::min(rails.run, guide.run);
      if (guide.fading > 0) {
        rails.run = std::min(rails.run, static_cast<std::uint32_t>(guide.fading));
      }
    }
    rails.done = 0;
    for (const Guide& guide : rails.guides) {
      const V sign = sign_of_left(guide);
      for (std::uint32_t i = 0; i < guide.slot->count; ++i) {
        const std::size_t at = guide.place_row + i * lanes;
        Run right, left_one;
        read(rails, guide, &rails.right[at], right);
        read(rails, guide, &rails.left[at], left_one);
        V* const in = row(rails.comes, at);
        for (std::uint32_t n = 0; n < rails.run; ++n) {
          in[n] = right[n] + sign * left_one[n];
        }
        if (guide.fading > 0) {
          read(rails, guide, &rails.next_right[at], right);
          read(rails, guide, &rails.next_left[at], left_one);
          for (std::uint32_t n = 0; n < rails.run; ++n) {
            in[n] += share_of_next(guide, n) * (right[n] + sign * left_one[n] - in[n]);
          }
        }
      }
    }
  }

  // Computes where every place would be at the end of the sample, with the known forces.
  template <class S>
  static void move_places(const Program& program, Rails<T>& rails, S& s) {
    const JunctionSlot* const place = program.junctions.data();
    const std::uint32_t* const gives = rails.gives.data();
    const V* in = row(rails.comes, 0) + rails.done;
    V* unforced = row(rails.goes, 0) + rails.done;
    for (std::size_t i = 0, count = rails.gives.size(); i < count; ++i) {
      const std::uint32_t node = place[i].node;
      const V way = 2 * *in - s.v[node];
      const V v = way + s.force[node] * s.coefficient[gives[i]];
      *unforced = way;
      s.v[node] = v;
      s.shift(node, v);
      s.force[node] = V{};
      in += waveguide_run;
      unforced += waveguide_run;
    }
  }

  // Adds the effect of all forces to the waves and advances by one sample.
  template <class S>
  static void advance_waves(const Program& program, Rails<T>& rails, const S& s) {
    const JunctionSlot* const place = program.junctions.data();
    V* wave = row(rails.goes, 0) + rails.done;
    for (std::size_t i = 0, count = rails.gives.size(); i < count; ++i) {
      *wave = s.v[place[i].node] - *wave;
      wave += waveguide_run;
    }
    if (++rails.done == rails.run) {
      write_run(rails);
    }
  }

 private:
  static V* row(Aligned<T>& numbers, std::size_t place_row) {
    return reinterpret_cast<V*>(numbers.data() + place_row * waveguide_run);
  }
  // Returns the cross-fade weight of the new delays, n samples into the run.
  static T share_of_next(const Guide& guide, std::uint32_t n) {
    return T(1) - static_cast<T>(guide.fading - static_cast<int>(n)) /
                      static_cast<T>(waveguide_fade_frames);
  }
  static V sign_of_left(const Guide& guide) { return V{} + (guide.slot->is_open ? T(1) : T(-1)); }

  // Calls `packs(first sample, its wave in each lane)` for squares of samples and lanes in which no
  // lane wraps around, and `one(sample, lane, wave)` for the remaining samples.
  template <class R, class Packs, class One>
  [[gnu::always_inline]] static void each(R& rails, const Guide& guide, const std::uint32_t* delay,
                                          Packs&& packs, One&& one) {
    decltype(rails.wave(guide, 0, 0)) wave[lanes];
    std::uint32_t furthest = 0;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::uint32_t slot = (rails.now - delay[lane]) & guide.mask;
      furthest = std::max(furthest, slot);
      wave[lane] = rails.wave(guide, lane, slot);
    }
    std::uint32_t n = 0;
    if (furthest + rails.run <= guide.mask + 1) {
      for (; n + lanes <= rails.run; n += lanes) {
        packs(n, wave);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
          wave[lane] += lanes;
        }
      }
    }
    for (; n < rails.run; ++n) {
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        one(n, lane, rails.wave(guide, lane, rails.now + n - delay[lane]));
      }
    }
  }

  static void read(const Rails<T>& rails, const Guide& guide, const std::uint32_t* delay, V* run) {
    each(
        rails, guide, delay,
        [&](std::uint32_t first, const auto& wave) {
          V square[lanes];
          for (std::size_t lane = 0; lane < lanes; ++lane) {
            square[lane] = load<V>(wave[lane]);
          }
          transpose(square);
          for (std::size_t n = 0; n < lanes; ++n) {
            run[first + n] = square[n];
          }
        },
        [&](std::uint32_t n, std::size_t lane, const T* wave) { run[n][lane] = *wave; });
  }
  // Adds to the ring, or overwrites it.
  template <bool adds>
  static void write(Rails<T>& rails, const Guide& guide, const std::uint32_t* delay, const V* run) {
    each(
        rails, guide, delay,
        [&](std::uint32_t first, const auto& wave) {
          V square[lanes];
          for (std::size_t n = 0; n < lanes; ++n) {
            square[n] = run[first + n];
          }
          transpose(square);
          for (std::size_t lane = 0; lane < lanes; ++lane) {
            store<V>(wave[lane], adds ? load<V>(wave[lane]) + square[lane] : square[lane]);
          }
        },
        [&](std::uint32_t n, std::size_t lane, T* wave) {
          *wave = adds ? *wave + run[n][lane] : run[n][lane];
        });
  }

  // Writes the changes of the waves, then the output of the filters, since the last place may be at
  // the filters.
  static void write_run(Rails<T>& rails) {
    for (Guide& guide : rails.guides) {
      const V sign = sign_of_left(guide);
      for (std::uint32_t i = 0; i < guide.slot->count; ++i) {
        const std::size_t at = guide.place_row + i * lanes;
        V* const wave = row(rails.goes, at);
        auto pushed = wave[0] != V{};
        for (std::uint32_t n = 1; n < rails.run; ++n) {
          pushed |= wave[n] != V{};
        }
        if (!any_of(pushed)) {
          continue;  // A place that is only an output has no force.
        }
        multiply(wave, V{} + T(0.5), rails.run);
        if (guide.fading > 0) {
          Run later;
          for (std::uint32_t n = 0; n < rails.run; ++n) {
            later[n] = share_of_next(guide, n) * wave[n];
            wave[n] -= later[n];
          }
          write<true>(rails, guide, &rails.next_right[at], later);
          multiply(later, sign, rails.run);
          write<true>(rails, guide, &rails.next_left[at], later);
        }
        write<true>(rails, guide, &rails.right[at], wave);
        multiply(wave, sign, rails.run);
        write<true>(rails, guide, &rails.left[at], wave);
      }
      reflect(rails, guide);
      if (guide.fading > 0) {
        guide.fading -= static_cast<int>(rails.run);
        if (guide.fading == 0) {
          arrive(rails, guide);
        }
      }
    }
    rails.now += rails.run;
    rails.run = 0;
  }
  static void multiply(V* run, V by, std::uint32_t count) {
    for (std::uint32_t n = 0; n < count; ++n) {
      run[n] *= by;
    }
  }

  // Applies the filters to the waves that reach them.
  static void reflect(Rails<T>& rails, const Guide& guide) {
    const std::size_t at = guide.row;
    Run wave, next;
    read(rails, guide, &rails.end[at], wave);
    if (guide.fading > 0) {
      read(rails, guide, &rails.next_end[at], next);
    }
    V lost = load<V>(&rails.pole_state[at]);
    V held = load<V>(&rails.allpass_state[at]);
    for (std::uint32_t n = 0; n < rails.run; ++n) {
      V c = load<V>(&rails.allpass[at]);
      V a = load<V>(&rails.pole[at]);
      V g = load<V>(&rails.gain[at]);
      if (guide.fading > 0) {
        const T share = share_of_next(guide, n);
        wave[n] += share * (next[n] - wave[n]);
        c += share * (load<V>(&rails.next_allpass[at]) - c);
        a += share * (load<V>(&rails.next_pole[at]) - a);
        g += share * (load<V>(&rails.next_gain[at]) - g);
      }
      lost = (1 - a) * wave[n] + a * lost;
      const V in = g * lost;
      const V out = c * in + held;
      held = in - c * out;
      wave[n] = out;
    }
    store<V>(&rails.pole_state[at], lost);
    store<V>(&rails.allpass_state[at], held);
    constexpr std::uint32_t here[lanes] = {};
    write<false>(rails, guide, here, wave);
  }

  static void arrive(Rails<T>& rails, Guide& guide) {
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
    guide.is_run_known = false;
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
