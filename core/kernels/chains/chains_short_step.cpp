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
  for (std::size_t left = block.frames, arrives = block.frames + 1 - ramps.frames; left > 0;
       --left) {
    k.advance(left == arrives);
    z.advance(left == arrives);
    move_short_chain<false>(here, chain, nullptr, s);
    each_below<packs>([&](auto i) {
      if ((read >> i & 1) != 0) {
        pairs[2 * i] = here.x[i];
      }
    });
    for (const PlacedInput& input : s.positions) {
      s.bodies[input.place] = value[input.index];
      s.bodies[input.place + S::lanes] = velocity[input.index];
    }
    s.held[0] = k.value;
    s.held[1] = z.value;
    for (const HeardPosition& output : s.heard_positions) {
      outputs[output.index] = s.bodies[output.place];
    }
    outputs += program.outputs.size();
    value += program.inputs.size();
    velocity += program.inputs.size();
  }
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
  if (!has_sites && !has_others && program.audio_coefficients.empty() &&
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
