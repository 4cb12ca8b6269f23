// bench: the ways of playing a scene, block by block. All of them play the same hands.
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

// The network of a scene, in one of its forms.
struct Formed {
  std::string method;
  Machine machine;  // of one part
};

// The kernels alone, as many as the voices need.
template <class T>
std::unique_ptr<Player> play_kernels(const BenchScene& scene, const Network& network,
                                     const Program& program, Isa isa);

// The whole engine with all its guards, notes held.
std::unique_ptr<Player> play_engine(const BenchScene& scene, const Network& network,
                                    const Machine& machine, Precision precision, Isa isa);

// The textbook simulator, one voice.
std::unique_ptr<Player> play_reference(const BenchScene& scene, const Network& network);

// A program of FAUST's for each voice.
std::unique_ptr<Player> play_faust(const BenchScene& scene, const Network& network,
                                   const FaustLibrary& library);

}  // namespace ressort::bench
