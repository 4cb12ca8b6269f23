// app/commands: plays the kernels of a machine without the engine: one voice, with inputs that move
// as functions of time.
#pragma once

#include <memory>
#include <vector>

#include "app/commands/chart/scenes.h"
#include "core/engine/engine.h"
#include "core/kernels/program.h"

namespace ressort::commands {

// [part][node]
using States = std::vector<std::vector<double>>;

class ChartPlayer {
 public:
  virtual ~ChartPlayer() = default;

  // Returns to the start.
  virtual void rewind() = 0;
  // Plays `frames` samples of the machine's own rate; writes [frame][channel] to `outputs` unless
  // it is null.
  virtual void play(std::size_t frames, double* outputs) = 0;
  // Copies all positions and velocities. Returns false if a kernel does not know them.
  virtual bool save(States& x, States& v) const = 0;
};

// Computes the motion of the inputs in advance for `seconds`; later samples are correct but slower.
std::unique_ptr<ChartPlayer> make_player(const Machine& machine,
                                         const std::vector<InputMotion>& motions, double seconds,
                                         Precision precision, Isa isa);

}  // namespace ressort::commands
