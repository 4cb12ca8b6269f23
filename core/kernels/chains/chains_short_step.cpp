// The step for a single short chain: its masses stay in registers for a block of samples. Values
// that others read are written to memory in each sample.
#include "core/kernels/chains/chains_loops.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Calls `use` with each index as a constant, so that indexed values stay in registers.
template <std::size_t count, class Use>
[[gnu::always_inline]] inline void each_below(Use&& use) {
  [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    (use(std::integral_constant<std::size_t, I>{}), ...);
  }
  (std::make_index_sequence<count>{});
}

template <class V, std::size_t packs>
struct ShortBody {
  V x[packs];
  V v[packs];
  V inverse_mass[packs];
};

template <class S, std::size_t packs>
void fill_inverse_masses(ShortBody<typename S::V, packs>& body, const FoldedChain& chain,
                         const S& s) {
  using V = typename S::V;
  const V inverse_mass = all<V>(s.coefficient[chain.mass.inverse_mass]);
  each_below<packs>([&](auto i) {
    body.inverse_mass[i] = inverse_mass * pack_at<V>(s.masks + (i <= chain.last ? 0 : S::lanes));
  });
}

// Moves the masses by the chain's springs and the forces on its sites.
template <bool has_sites, class S, std::size_t packs>
void move_short_chain(ShortBody<typename S::V, packs>& body, const FoldedChain& chain,
                      const ShortSite* site, const S& s) {
  using V = typename S::V;
  const auto others = std::make_index_sequence<S::lanes - 1>{};
  const V k = all<V>(s.held[0]);
  const V z = all<V>(s.held[1]);
  V y[packs];
  each_below<packs>([&](auto i) { y[i] = k * body.x[i] + z * body.v[i]; });
  const V left = tension_of(chain.left, s.held, y[0], s);
  const V right = tension_of(chain.right, s.held, y[0], s);
  V before = y[0] - up(left, y[packs - 1], others);
  each_below<packs>([&](auto i) {
    V next = down(y[0], right, others);
    if constexpr (i + 1 < packs) {
      next = y[i + 1];
    }
    const V after = next - y[i];
    V force = after - before;
    before = after;
    if constexpr (has_sites) {
      for (; site->pack == i; ++site) {
        force += all<V>(s.force[site->force]) * pack_at<V>(s.units + site->unit);
        s.force[site->force] = 0;
      }
    }
    body.v[i] += force * body.inverse_mass[i];
    body.x[i] += body.v[i];
  });
}

template <class T>
bool are_springs_all_that_ramps(const FoldedChain& chain, const Ramps<T>& ramps) {
  bool are_all = true;
  for (std::size_t i = 0; i < ramps.count && ramps.frames > 0; ++i) {
    const std::uint32_t c = ramps.ramping[i];
    are_all &= c == chain.springs[0] || c == chain.springs[1];
  }
  return are_all;
}

// One coefficient that moves as in advance().
template <class T>
struct Ramp {
  Ramp(const Ramps<T>& ramps, std::uint32_t c) : value(ramps.value[c]), target(value) {
    for (std::size_t i = 0; i < ramps.count && ramps.frames > 0; ++i) {
      if (ramps.ramping[i] == c) {
        increment = ramps.increment[c];
        target = ramps.target[c];
      }
    }
  }
  void advance(bool arrives) {
    value = arrives ? target : value + increment;
    increment = arrives ? T(0) : increment;
  }

  T value;
  T target;
  T increment = 0;
};

// The numbers that move_ahead() keeps from one sample to the next.
template <class S, std::size_t packs>
struct Ahead {
  using V = typename S::V;
  using T = typename S::Number;

  explicit Ahead(const ShortBody<V, packs>& body) {
    each_below<packs>([&](auto i) { late[i] = body.x[i] - body.v[i]; });
  }
  void take(const ShortBody<V, packs>& body, const FoldedChain& chain, const S& s) {
    each_below<packs>([&](auto i) {
      position[i] = body.inverse_mass[i] * all<V>(s.held[0]);
      speed[i] = body.inverse_mass[i] * all<V>(s.held[0] + s.held[1]);
      own[i] = T(1) - T(2) * speed[i];
    });
    left_v = all<V>(s.bodies[chain.left + S::lanes]);
    left_x = all<V>(s.bodies[chain.left]) - left_v;
    right_v = all<V>(s.bodies[chain.right + S::lanes]);
    right_x = all<V>(s.bodies[chain.right]) - right_v;
  }

  V late[packs];      // positions one sample ago
  V position[packs];  // k / m
  V speed[packs];     // (k + z) / m
  V own[packs];       // 1 - 2 (k + z) / m
  V left_x;
  V left_v;
  V right_x;
  V right_v;
};

// Does the same as move_short_chain() without sites, by k x[n] + z v[n] = k x[n-1] + (k + z) v[n].
// A sample then waits for the one before it for less than half of the time.
template <class S, std::size_t packs>
void move_ahead(ShortBody<typename S::V, packs>& body, Ahead<S, packs>& ahead) {
  using V = typename S::V;
  const auto others = std::make_index_sequence<S::lanes - 1>{};
  V x_before = up(ahead.left_x, ahead.late[packs - 1], others);
  V v_before = up(ahead.left_v, body.v[packs - 1], others);
  const V x_end = down(ahead.late[0], ahead.right_x, others);
  const V v_end = down(body.v[0], ahead.right_v, others);
  V v[packs];
  each_below<packs>([&](auto i) {
    V x_after = x_end;
    V v_after = v_end;
    if constexpr (i + 1 < packs) {
      x_after = ahead.late[i + 1];
      v_after = body.v[i + 1];
    }
    const V bend = ahead.position[i] * ((x_before + x_after) - ahead.late[i] * 2);
    v[i] = (bend + ahead.own[i] * body.v[i]) + ahead.speed[i] * (v_before + v_after);
    x_before = ahead.late[i];
    v_before = body.v[i];
  });
  each_below<packs>([&](auto i) {
    ahead.late[i] = body.x[i];
    body.v[i] = v[i];
    body.x[i] += v[i];
  });
}

// The rounding errors of move_ahead() would be too large in single precision.
template <class T, std::size_t packs>
constexpr bool goes_ahead = sizeof(T) == sizeof(double) && packs <= 3;

// Steps a block of a chain with no other links than those that hold its ends. All of its data is in
// registers, which saves a quarter of the time.
template <class S, std::size_t packs, class T>
[[gnu::flatten]] void step_alone(const Program& program, const FoldedChain& chain,
                                 std::uint32_t read, ShortBody<typename S::V, packs>& body,
                                 typename S::V* pairs, const Ramps<T>& ramps, const Block<T>& block,
                                 S& s) {
  Ramp<T> k(ramps, chain.springs[0]);
  Ramp<T> z(ramps, chain.springs[1]);
  const T* value = block.value;
  const T* velocity = block.velocity;
  T* outputs = block.outputs;
  ShortBody<typename S::V, packs> here = body;
  Ahead<S, packs> ahead(here);
  const auto step = [&]<bool moves>(std::size_t from, std::size_t end) {
    if constexpr (goes_ahead<T, packs>) {
      ahead.take(here, chain, s);
    }
    for (std::size_t frame = from; frame < end; ++frame) {
      if constexpr (moves) {
        k.advance(frame + 1 == ramps.frames);
        z.advance(frame + 1 == ramps.frames);
      }
      if constexpr (goes_ahead<T, packs>) {
        if (moves) {
          ahead.take(here, chain, s);
        }
        move_ahead(here, ahead);
      } else {
        move_short_chain<false>(here, chain, nullptr, s);
      }
      each_below<packs>([&](auto i) {
        if (packs <= 3 || (read >> i & 1) != 0) {
          pairs[2 * i] = here.x[i];
        }
      });
      if constexpr (moves) {
        for (const PlacedInput& input : s.positions) {
          s.bodies[input.place] = value[input.index];
          s.bodies[input.place + S::lanes] = velocity[input.index];
        }
        s.held[0] = k.value;
        s.held[1] = z.value;
        value += program.inputs.size();
        velocity += program.inputs.size();
      }
      for (const HeardPosition& output : s.heard_positions) {
        outputs[output.index] = s.bodies[output.place];
      }
      outputs += program.outputs.size();
    }
  };
  // The first sample's springs can differ from those of the next.
  const std::size_t moving = s.positions.first != s.positions.last
                                 ? block.frames
                                 : std::min(std::max<std::size_t>(1, ramps.frames), block.frames);
  step.template operator()<true>(0, moving);
  step.template operator()<false>(moving, block.frames);
  ramps.value[chain.springs[0]] = k.value;
  ramps.value[chain.springs[1]] = z.value;
  body = here;
}

// Flattened, because a call would spill the registers to memory.
template <class S, std::size_t packs, class T>
[[gnu::flatten]] void step_short(const Program& program, const ChainsTables& tables,
                                 ChainsState<T>& state, const Block<T>& block) {
  using V = typename S::V;
  S s(tables, state);
  Ramps<T> ramps = state.ramps;
  ramps.width = 1;
  const Table<std::uint32_t> audio_coefficients(program.audio_coefficients);
  const FoldedChain chain = *s.chains.first;
  const ShortSite* const sites = tables.short_sites.data();
  const std::uint32_t read = tables.short_read;
  V* const pairs = &pack_at<V>(s.bodies + chain.first);
  const T* value = block.value;
  const T* velocity = block.velocity;
  const T* audio = block.audio;
  T* outputs = block.outputs;
  const std::size_t inputs = program.inputs.size();
  const std::size_t output_count = program.outputs.size();
  const std::size_t frames = block.frames;
  const bool has_forces = std::any_of(s.forces.first, s.forces.last, [&](const PlacedInput& input) {
    return !block.is_still || value[input.index] != 0;
  });
  const bool has_others = s.loose_runs.first != s.loose_runs.last ||
                          s.link_runs.first != s.link_runs.last || has_forces;
  const bool has_sites = sites->pack != nowhere && has_others;
  // The first empty place after the last mass repeats the node that holds the end.
  if (tables.short_end != nowhere) {
    s.bodies[tables.short_end] = s.bodies[chain.right];
  }
  ShortBody<V, packs> body;
  each_below<packs>([&](auto i) {
    body.x[i] = pairs[2 * i];
    body.v[i] = pairs[2 * i + 1];
  });
  T inverse_mass = s.coefficient[chain.mass.inverse_mass];
  fill_inverse_masses(body, chain, s);
  std::size_t frame = 0;
  const bool are_ends_held = chain.left != nowhere && chain.right != nowhere;
  if (!has_sites && !has_others &&
      (are_ends_held || !goes_ahead<T, packs>)&&program.audio_coefficients.empty() &&
      are_springs_all_that_ramps(chain, ramps)) {
    step_alone(program, chain, read, body, pairs, ramps, block, s);
    frame = frames;
  }
  for (; frame < frames; ++frame) {
    if (ramps.frames > 0 || audio_coefficients.first != audio_coefficients.last) {
      advance(ramps);
      for (const std::uint32_t c : audio_coefficients) {
        ramps.value[c] = *audio++;
      }
      if (s.coefficient[chain.mass.inverse_mass] != inverse_mass) {
        inverse_mass = s.coefficient[chain.mass.inverse_mass];
        fill_inverse_masses(body, chain, s);
      }
    }
    if (has_others) {
      for (const PlacedInput& input : s.forces) {
        s.force[input.force] += value[input.index];
      }
    }
    if (has_sites) {
      move_short_chain<true>(body, chain, sites, s);
    } else {
      move_short_chain<false>(body, chain, sites, s);
    }
    each_below<packs>([&](auto i) {
      if ((read >> i & 1) != 0) {
        pairs[2 * i] = body.x[i];
        pairs[2 * i + 1] = body.v[i];
      }
    });
    if (has_others) {
      step_loose(s);
    }
    for (const PlacedInput& input : s.positions) {
      s.bodies[input.place] = value[input.index];
      s.bodies[input.place + S::lanes] = velocity[input.index];
    }
    if (has_others) {
      step_links(s);
    }
    s.held[0] = s.coefficient[chain.springs[0]];
    s.held[1] = s.coefficient[chain.springs[1]];
    for (const HeardPosition& output : s.heard_positions) {
      outputs[output.index] = s.bodies[output.place];
    }
    outputs += output_count;
    value += inputs;
    velocity += inputs;
  }
  each_below<packs>([&](auto i) {
    pairs[2 * i] = body.x[i];
    pairs[2 * i + 1] = body.v[i];
  });
}

template <class T, std::size_t bytes, std::size_t... counts>
ChainsStep<T> step_for(std::size_t packs, std::index_sequence<counts...>) {
  ChainsStep<T> step = nullptr;
  static_cast<void>(
      ((packs == counts && (step = step_short<View<T, bytes>, counts, T>, true)) || ...));
  return step;
}

template <class T>
ChainsStep<T> step_for(std::size_t bytes, std::size_t packs) {
  constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);
  return with_bytes<widest, std::min<std::size_t>(32, widest)>(
      bytes, [=]<std::size_t pack>() { return step_for<T, pack>(packs, ShortPacks{}); });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
ChainsStep<float> short_chain_step<Isa::RESSORT_ISA, float>(std::size_t bytes, std::size_t packs) {
  return RESSORT_ISA::step_for<float>(bytes, packs);
}

template <>
ChainsStep<double> short_chain_step<Isa::RESSORT_ISA, double>(std::size_t bytes,
                                                              std::size_t packs) {
  return RESSORT_ISA::step_for<double>(bytes, packs);
}

}  // namespace ressort::kernels
