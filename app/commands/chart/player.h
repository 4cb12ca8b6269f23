// app/commands: plays a machine's kernels alone, one voice, with inputs whose motion is a function
// of time.
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

  // To where the machine starts, at time 0.
  virtual void rewind() = 0;
  // To any other state, the inputs where they start.
  virtual void place(const States& x, const States& v) = 0;
  // The next `frames` samples of the machine's own rate; [frame][channel] to `outputs`, if it is
  // not null.
  virtual void play(std::size_t frames, double* outputs) = 0;
  // Where every node is, and how fast; false where a kernel does not know.
  virtual bool save(States& x, States& v) const = 0;
};

// With the motion of the machine's inputs, known beforehand for `seconds`: what is played later is
// right too, but slower.
std::unique_ptr<ChartPlayer> make_player(const Machine& machine,
                                         const std::vector<InputMotion>& motions, double seconds,
                                         Precision precision, Isa isa);

}  // namespace ressort::commands
