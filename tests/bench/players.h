// bench: players of a scene, block by block, with the same motion of the inputs.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "core/compile/machine.h"
#include "core/engine/engine.h"
#include "core/kernels/kernel.h"
#include "core/model/network.h"
#include "tests/bench/bench_scenes.h"
#include "tests/bench/faust.h"

namespace ressort::bench {

class Player {
 public:
  virtual ~Player() = default;
  virtual void play(std::size_t block) = 0;  // of the cycle
};

// The network of a scene in one of its forms.
struct Formed {
  std::string method;
  Machine machine;  // has one part
};

// Plays the kernels alone, as many as the voices need.
template <class T>
std::unique_ptr<Player> play_kernels(const BenchScene& scene, const Network& network,
                                     const Program& program, Isa isa);

// Plays the whole engine with its guards, with held notes.
std::unique_ptr<Player> play_engine(const BenchScene& scene, const Network& network,
                                    const Machine& machine, Precision precision, Isa isa);

// Plays the textbook simulator with one voice.
std::unique_ptr<Player> play_reference(const BenchScene& scene, const Network& network);

// Plays one FAUST program for each voice.
std::unique_ptr<Player> play_faust(const BenchScene& scene, const Network& network,
                                   const FaustLibrary& library);

}  // namespace ressort::bench
