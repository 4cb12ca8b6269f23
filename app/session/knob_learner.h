// app/session: recognises a controller by the messages of one turn.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "app/rooms.h"
#include "core/controller.h"

namespace ressort::session {

class KnobLearner {
 public:
  // Adds a MIDI controller message. Pedals, bank select and channel modes do not count.
  void add(int channel, int controller, int value);
  bool has_any() const { return !sources_.empty(); }
  // Returns the source that has sent most, with its channel: an encoder of the kind that sends
  // these values, a pair of 14 bits, an NRPN, or else an absolute controller.
  std::optional<ControllerInput> found() const;

 private:
  struct Source {
    ControllerInput input;
    std::vector<int> values;
    std::size_t low_halves = 0;  // of values with 14 bits
  };
  Source& source(ControllerSource kind, int number, int channel);

  std::vector<Source> sources_;
  std::array<std::optional<int>, 16> nrpn_{};  // [channel] selected number
};

}  // namespace ressort::session
