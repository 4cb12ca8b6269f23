// core/kernels: memory of a kernel for its passive links.
#pragma once

#include <algorithm>

#include "core/kernels/passive/clusters.h"
#include "core/lanes.h"

namespace ressort::kernels {

// State kept between samples, and work memory of the solver.
template <class T>
struct PassiveRoom {
  PassiveRoom(const Program& program, std::size_t width)
      : tables(passive_tables(program)),
        memory(tables.links.size() * passive_rows * width),
        awake(width) {
    if (tables.links.empty()) {
      return;
    }
    std::size_t most = 0;
    for (const Cluster& cluster : tables.clusters) {
      most = std::max(most, cluster.numbers() + cluster.count);
    }
    most += tables.web.numbers();
    numbers.resize(most * widest_bytes / sizeof(T));
    inverse_mass = inverse_masses(program);
    const auto is_force = [](const OutputSlot& output) { return output.is_force; };
    if (std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
      felt.resize(program.position.size() * width);
    }
  }
  T* felt_or_null() { return felt.empty() ? nullptr : felt.data(); }

  PassiveTables tables;
  std::vector<std::uint32_t> inverse_mass;
  Aligned<T> memory;   // [pack][link][passive_rows][lane]
  Aligned<T> numbers;  // Work memory for one cluster of one pack.
  Aligned<T> awake;
  Aligned<T> felt;
};

}  // namespace ressort::kernels
