// core/compile: the stages that check the memory, find the gain and make the engine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/engine/engine.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::compile {

// Estimates the memory of an engine with this number of voices, in bytes, within a factor of two
// for large engines. Live helper threads work on copies. O(parts). [any thread]
std::uint64_t engine_bytes(const Machine& machine, int voices, Precision precision,
                           const Executor* executor);

// Returns an error if the engine would not fit into `most_bytes`; it names the number of voices
// that would. Called before the memory is allocated. [any thread]
std::optional<Error> check_memory(const Machine& machine, int voices, Precision precision,
                                  const Executor* executor, std::uint64_t most_bytes);

// Peak of a loud note at the gain that find_gain() returns: -6 dBFS.
inline constexpr double found_gain_peak = 0.5;

// Plays a forte note and returns the gain at which it peaks at -6 dBFS. `playing`: one voice at
// gain 1. Returns 1 if the note makes no sound. Plays about 4 million steps of a mass; returns
// nothing if even the first 50 ms could take seconds. [any thread but audio]
std::optional<double> find_gain(const Machine& machine, const Playing& playing, Precision precision,
                                Isa isa, const Progress& progress);

// O(voices * elements) in time and memory. [any thread but audio]
std::unique_ptr<Engine> make_engine(Machine machine, Playing playing, Precision precision, Isa isa,
                                    const Progress& progress, Executor* executor);

}  // namespace ressort::compile
