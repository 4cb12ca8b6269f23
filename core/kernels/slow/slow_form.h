// core/kernels: whether a Program moves so slowly that few points of it are enough, and its tables.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// What the fastest mode may have in a coarse step: the fourth order is then as near to the
// continuous network as 70 dB after a thousand steps, and the cubic between the steps nearer still.
inline constexpr double most_slow_stiffness = 0.05;  // K/M
inline constexpr double most_slow_damping = 0.1;     // Z/M

// Stepped once in so many samples; nothing where the fourth-order form cannot do that, where it is
// not all springs, or has points or force outputs, or depends on audio.
std::optional<Slow> slow_by(const Program& program, std::uint32_t frames);

// By the largest power of two, up to 1024, that keeps below these figures at `highest_factor` times
// every stiffness; nothing where that is below 4. O(links). [any thread but audio]
std::optional<Slow> slow_form(const Program& program, double highest_factor);

// What the registry's row of it asks, of one voice in bytes.
double predicted_ns(const Program& program, const Slow& form, const Workload& load);
std::string description(const Program& program, const Slow& form);
std::uint64_t voice_bytes(const Program& program, const Slow& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
