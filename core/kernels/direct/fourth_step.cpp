// The direct form to fourth order, compiled for each instruction set.
#include "core/kernels/direct/direct_loops.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// A view with a second pass over the linear links.
template <class T, std::size_t Bytes>
struct Ahead : View<T, Bytes> {
  using V = typename View<T, Bytes>::V;
  static constexpr bool takes_passive = false;
  static constexpr bool takes_rails = false;

  explicit Ahead(DirectState<T>& state)
      : View<T, Bytes>(state),
        damping(reinterpret_cast<V*>(state.own(0))),
        ahead(reinterpret_cast<V*>(state.own(1))),
        faster(reinterpret_cast<V*>(state.own(2))) {}

  V* damping;  // the linear dampers' share of the force
  V* ahead;    // a_s/12; 0 where nothing moves
  V* faster;   // a/2; 0 where nothing moves
};

// Where masses are going, and what their own springs make of it.
template <class S>
void look_ahead(const Program& program, S& s) {
  using V = typename S::V;
  using T = Scalar<V>;
  for (const MassRun& run : program.mass_runs) {
    const V w = s.coefficient[run.inverse_mass];
    const V twelfth = w / T(12);
    const V half = w / T(2);
    const V k = run.is_oscillator ? s.coefficient[run.stiffness] : V{};
    const V z = run.is_oscillator ? s.coefficient[run.damping] : V{};
    const V g = run.has_gravity ? s.coefficient[run.gravity] : V{};
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      const V own = z * s.v[i];
      const V force = s.force[i] - k * s.x[i] - own - g;
      const V ahead = (force - s.damping[i] + own) * twelfth;
      const V faster = force * half;
      s.ahead[i] = ahead;
      s.faster[i] = faster;
      s.force[i] = force - k * ahead - z * faster;
      s.damping[i] = V{};
    }
  }
}

// Calls use(K, Z, ends, count) for the linear links.
template <class S, class Use>
void each_spring(const Program& program, S& s, Use&& use) {
  using V = typename S::V;
  for (const FourthLinks& links : s.state.fourth->springs) {
    const LinkRun& run = program.link_runs[links.run];
    const V k = s.coefficient[run.coefficients[0]];
    const V z = s.coefficient[run.coefficients[1]];
    use(k, z, program.ends.data() + links.first, links.count);
  }
}

// What the springs and dampers pull besides, for masses that are ahead and faster.
template <class T, std::size_t Bytes>
void step_masses(const Program& program, Ahead<T, Bytes>& s) {
  using V = typename Ahead<T, Bytes>::V;
  look_ahead(program, s);
  each_spring(program, s, [&](V k, V z, const Ends* ends, std::uint32_t count) {
    exert(ends, count, s, [&](std::uint32_t a, std::uint32_t b) {
      return laws::Spring<V>{k, z}.force(s.ahead[a] - s.ahead[b], s.faster[a] - s.faster[b]);
    });
  });
  for (const MassRun& run : program.mass_runs) {
    move_masses(run, s, [](V, V) { return V{}; });
  }
  rest_others(program, s);
}

template <class T, std::size_t Bytes>
void pull(const Program& program, Ahead<T, Bytes>& s) {
  using V = typename Ahead<T, Bytes>::V;
  for (const FourthLinks& links : s.state.fourth->others) {
    exert_law(program, program.link_runs[links.run], links.first, links.count, s);
  }
  spread_taps(program, s);
  each_spring(program, s, [&](V k, V z, const Ends* ends, std::uint32_t count) {
    exert(ends, count, s, [&](std::uint32_t a, std::uint32_t b) {
      const V damping = z * (s.v[a] - s.v[b]);
      s.damping[a] -= damping;
      s.damping[b] += damping;
      return k * (s.x[a] - s.x[b]) + damping;
    });
  });
}

template <class T>
DirectLoops<T> loops_for(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(bytes, []<std::size_t pack>() {
    return DirectLoops<T>{step<Ahead<T, pack>, T>, nullptr};
  });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
DirectLoops<float> fourth_loops<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<float>(bytes);
}

template <>
DirectLoops<double> fourth_loops<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<double>(bytes);
}

}  // namespace ressort::kernels
