// core/kernels: the interface of the simultaneous solver for passive links (joint_solver.h). The
// solver is large and independent of the kernel, so it is compiled once per pack type and
// instruction set, in joint_step.cpp, without fused multiply-adds like the direct kernel. Included
// by *_step.cpp.
#pragma once

#include "core/kernels/passive/clusters.h"
#include "core/lanes.h"
#include "core/laws/discrete_gradient.h"

namespace ressort::kernels::RESSORT_ISA {

// A link of a cluster in one sample.
template <class V>
struct Joined {
  V before;  // Distance one sample ago.
  V speed;   // Change from then to now.
  V free;    // Further change to the next sample without the cluster's forces.
  V step;    // Change over both samples with the forces.
  V force;   // Force that it exerts.
  V steady;  // Part of the force that does not depend on the step.
  V damping;
  V value;  // Force of its law for this step.
  V slope;  // Derivative of that by the step, or its substitute.
  V way;    // Search direction, and the change of force at its end.
  V push;
  V newton_way;  // The last search direction of Newton's method.
  V newton_push;
};
static_assert(sizeof(Joined<double>) == joint_numbers * sizeof(double));

// A strided view of a kernel's coefficients, in packs.
template <class V>
struct CoefficientView {
  V operator[](std::size_t c) const { return first[c * stride]; }

  const V* first;
  std::size_t stride = 1;
};

// The motion of a link's ends without the link.
template <class V>
struct FreeMotion {
  V distance;
  V speed;
};

// Type-erased access to a kernel's Body (passive.h).
template <class V>
class JointBody {
 public:
  virtual FreeMotion<V> free_motion(Ends ends) const = 0;
  virtual V gamma(Ends ends) const = 0;
  virtual V coupling(Ends one, Ends other) const = 0;
  virtual void push(Ends ends, V force) = 0;
  virtual void shift(std::uint32_t node, V way) = 0;
  virtual void add_reaction(std::uint32_t node, V force) = 0;
  virtual V give(std::uint32_t from, std::uint32_t at) const = 0;
  virtual void push_node(std::uint32_t node, V force) = 0;

  CoefficientView<V> coefficients() const { return coefficients_; }
  V awake() const { return awake_; }
  bool has_masses() const { return has_masses_; }

 protected:
  JointBody(CoefficientView<V> coefficients, V awake, bool has_masses)
      : coefficients_(coefficients), awake_(awake), has_masses_(has_masses) {}
  ~JointBody() = default;

 private:
  CoefficientView<V> coefficients_;
  V awake_;
  bool has_masses_;
};

// The functions compiled in joint_step.cpp.
template <class V>
struct JointSolver {
  // Solves one cluster and moves its links' ends. `memory` belongs to its links:
  // [link][passive_rows]. `numbers` are Cluster::numbers() packs; afterwards they begin with the
  // links' Joined. `drag` is that of a web, [link], or null. [audio]
  static void solve(const std::vector<PassiveLink>& links, const Cluster& cluster, V* memory,
                    V* numbers, JointBody<V>& body, const V* drag = nullptr);

  // Returns the force of a single link in a lane's first sample. `before` and `speed` are those of
  // LinkState; `free` is the change of distance over two samples without the link. [audio]
  static V first_force(const PassiveLink& link, CoefficientView<V> coefficients, V before, V speed,
                       V free, V gamma);
};

namespace {

// Relative energy error that rounding can cause.
template <class V>
constexpr Scalar<V> share_of_rounding = laws::tiny_share<V>() * 2;

// Tells whether a kernel's masses are nodes of their own.
template <class Body, class V>
concept HasMasses = requires(Body body) {
  body.shift(0u, V{});
};

template <class V, class Body>
class JointOf final : public JointBody<V> {
 public:
  explicit JointOf(Body& body)
      : JointBody<V>(body.coefficients(), body.awake(), HasMasses<Body, V>), body_(body) {}

  FreeMotion<V> free_motion(Ends ends) const override {
    return {body_.distance(ends), body_.speed(ends)};
  }
  V gamma(Ends ends) const override { return body_.gamma(ends); }
  V coupling(Ends one, Ends other) const override {
    if constexpr (requires { body_.coupling(one, other); }) {
      return body_.coupling(one, other);
    } else if constexpr (requires { body_.give(0u, 0u); }) {
      return body_.give(one.a, other.a) + body_.give(one.b, other.b) - body_.give(one.a, other.b) -
             body_.give(one.b, other.a);
    } else {
      const auto [a, b] = one;
      const auto [c, d] = other;
      return (body_.gamma({a, d}) + body_.gamma({b, c}) - body_.gamma({a, c}) -
              body_.gamma({b, d})) /
             2;
    }
  }
  void push(Ends ends, V force) override { body_.push(ends, force); }
  void shift([[maybe_unused]] std::uint32_t node, [[maybe_unused]] V way) override {
    if constexpr (HasMasses<Body, V>) {
      body_.shift(node, way);
    }
  }
  void add_reaction([[maybe_unused]] std::uint32_t node, [[maybe_unused]] V force) override {
    if constexpr (HasMasses<Body, V>) {
      body_.add_reaction(node, force);
    }
  }
  V give([[maybe_unused]] std::uint32_t from, [[maybe_unused]] std::uint32_t at) const override {
    if constexpr (requires { body_.give(from, at); }) {
      return body_.give(from, at);
    } else {
      return V{};
    }
  }
  void push_node([[maybe_unused]] std::uint32_t node, [[maybe_unused]] V force) override {
    if constexpr (requires { body_.push_node(node, force); }) {
      body_.push_node(node, force);
    }
  }

 private:
  Body& body_;
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
