// The simultaneous solver and the first sample of a single link, for every pack type. Compiled for
// each instruction set, without fused multiply-adds.
#include "core/kernels/passive/joint_solver.h"

namespace ressort::kernels::RESSORT_ISA {

template <class V>
void JointSolver<V>::solve(const std::vector<PassiveLink>& links, const Cluster& cluster, V* memory,
                           V* numbers, JointBody<V>& body, const V* drag) {
  const PassiveLink* const first = links.data() + cluster.first;
  auto* const joined = reinterpret_cast<Joined<V>*>(numbers);
  V* const rest = numbers + joint_numbers * cluster.count;
  if (body.has_masses() && cluster.ends() > 0) {
    ByEnds<V> space(first, cluster, rest, body);
    Joint<V, ByEnds<V>>(first, cluster.count, memory, joined, space, body).solve();
  } else {
    ByLinks<V> space(first, cluster, rest, body, drag);
    Joint<V, ByLinks<V>>(first, cluster.count, memory, joined, space, body).solve();
  }
}

template <class V>
V JointSolver<V>::first_force(const PassiveLink& link, CoefficientView<V> coefficients, V before,
                              V speed, V free, V gamma) {
  const JointLaws<V> own(&link, coefficients);
  const V force = laws::force_between(V{}, free, free, gamma,
                                      [&](V step) { return own.first(0, before, speed, step); });
  // A link that starts with energy is held by at most the force that keeps it at its start, so that
  // it is not thrown back.
  const auto is_thrown = absolute(force) * gamma > absolute(free);
  return select(is_thrown, free / select(is_thrown, gamma, V{} + 1), force);
}

template struct JointSolver<float>;
template struct JointSolver<double>;
template struct JointSolver<Pack<float, 16>>;
template struct JointSolver<Pack<double, 16>>;
#ifdef __AVX__
template struct JointSolver<Pack<float, 32>>;
template struct JointSolver<Pack<double, 32>>;
#endif
#ifdef __AVX512F__
template struct JointSolver<Pack<float, 64>>;
template struct JointSolver<Pack<double, 64>>;
#endif

}  // namespace ressort::kernels::RESSORT_ISA
