// core/kernels: decides whether a Program is a small body for many voices, and makes its tables.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/kernels/program.h"

namespace ressort::kernels {

struct Workload;
class Work;

// A spring of a Batch; it may be absent.
struct BatchSpring {
  static constexpr std::uint32_t none = 0xffffffffu;
  std::uint32_t stiffness = none;  // coefficients
  std::uint32_t damping = none;
  std::uint32_t node = none;  // the node without inertia to which an anchor is attached
};

// Any other link of a Batch.
struct BatchLink {
  std::uint32_t run = 0;  // index into Program::link_runs
  std::uint32_t a = 0;    // nodes
  std::uint32_t b = 0;
};

inline constexpr std::uint32_t most_held_masses = 4;
inline constexpr std::uint32_t most_held_pairs = 6;

// A small body in many voices; several packs of voices are stepped as one. Up to most_held_masses
// masses stay in registers, with the springs between any two of them and one anchor each; all other
// links are stepped one by one. Networks of more masses are stepped in memory, element by element.
struct Batch {
  std::array<BatchSpring, most_held_pairs> pairs;     // masses (0, 1), (0, 2), (1, 2), (0, 3)...
  std::array<BatchSpring, most_held_masses> anchors;  // [mass]
  std::vector<BatchLink> links;
};

// Larger bodies do not fit into the cache together with their voices.
inline constexpr std::uint32_t most_batch_masses = 16;

// Returns nothing if no mass moves, or if the Program has more than most_batch_masses masses,
// points or force outputs. O(links). [any thread but audio]
std::optional<Batch> batch_form(const Program& program);

// Functions for the registry's row; memory is per voice, in bytes.
double operations(const Program& program, const Batch& form, const Workload& load);
std::string description(const Program& program, const Batch& form);
std::uint64_t voice_bytes(const Program& program, const Batch& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
