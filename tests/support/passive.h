// tests: the kernel of a network with passive or published links.
#pragma once

#include <string>
#include <vector>

#include "core/compile/schemes.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"

namespace ressort::support {

inline Schemes schemes_of(const Network& network, Passivity passive) {
  return choose_schemes(network, {.passive = passive});
}

inline Program program_of(const std::string& text, Passivity passive) {
  const Network network = expand_macros(network_of(text));
  return make_program(network, Network::reference_rate_hz, true,
                      schemes_of(network, passive).links);
}

// Positions and speeds of all nodes; masses come first.
template <class T>
struct Stepper : Bare<T> {
  Stepper(const std::string& text, Passivity passive, Isa isa = best_isa())
      : Bare<T>(program_of(text, passive), 1, isa),
        x(this->program().position.size()),
        v(x.size()) {}

  // Places one mass; the next sample is free flight.
  void set_state(double x0, double v0) {
    x = this->program().position;
    v = this->program().velocity;
    x[0] = x0;
    v[0] = v0;
    this->kernel().set_state(0, x.data(), v.data());
  }
  void go(const std::vector<double>& inputs = {}) {
    this->step(inputs);
    this->kernel().save(0, x.data(), v.data());
  }

  std::vector<double> x;
  std::vector<double> v;
};

struct Spread {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  void add(double value) {
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
  }
};

}  // namespace ressort::support
