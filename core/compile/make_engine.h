// core/compile: from a machine in its forms to an engine that sounds.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/engine/engine.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::compile {

// About as many bytes as an engine of this machine, in its forms, takes with so many voices; within
// a factor of two where that is much. Helpers that nobody waits for have copies. O(parts). [any
// thread]
std::uint64_t engine_bytes(const Machine& machine, int voices, Precision precision,
                           const Executor* executor);

// What to say where they do not fit into `most_bytes`, and how many would. Asked before the memory
// is taken: afterwards it would be too late. [any thread]
std::optional<Error> shortage(const Machine& machine, int voices, Precision precision,
                              const Executor* executor, std::uint64_t most_bytes);

// What a loud note peaks at by the gain that find_gain() finds.
inline constexpr double found_gain_peak = 0.5;

// The gain at which a forte note peaks at -6 dBFS, found by playing one: what a model that comes
// without a preset is played with. `playing`: by one voice at gain 1. 1 where notes excite nothing.
// Bounded to about 4 million steps of a mass; nothing where even the beginning of a note might take
// seconds. [any thread but audio]
std::optional<double> find_gain(const Machine& machine, const Playing& playing, Precision precision,
                                Isa isa, const Progress& progress);

// At its gain, what is below -120 dBFS may sleep whatever else sounds. O(voices * elements) in time
// and memory. [any thread but audio]
std::unique_ptr<Engine> make_engine(Machine machine, Playing playing, Precision precision, Isa isa,
                                    const Progress& progress, Executor* executor);

}  // namespace ressort::compile
