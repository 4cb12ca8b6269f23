// app/devices: what a device's ports are connected to, by name, so that it can be connected again.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::devices {

// A connection of one of our ports, whichever way the sound goes.
struct Cable {
  std::string ours;    // the port, without its client: that may be called differently next time
  std::string theirs;  // "client:port"
  bool operator==(const Cable&) const = default;
};

// Remembers every cable that there was until a person pulls it. What goes with its port, or with
// the whole server, is missing until it can be plugged in again. [control]
class Wiring {
 public:
  static constexpr std::size_t most_cables = 1024;  // then the oldest are forgotten

  // All cables that there are now. One that is gone was pulled if its other port is still there at
  // a later look, when all `is_quiet`: a client that leaves takes its cables first, its ports then.
  void look(const std::vector<Cable>& present,
            const std::function<bool(const std::string& port)>& exists, bool is_quiet);

  // One has gone, and whether it was pulled a later look will tell.
  bool is_in_doubt() const;

  // To be plugged in once both ports are there.
  std::vector<Cable> missing() const;

  // It was plugged in once, whatever became of it.
  bool knows(const Cable& cable) const;

  // A port of others has gone, and its cables with it, whether or not it has come back meanwhile.
  void lose(const std::string& theirs);
  // The device is gone, and its cables with it.
  void lose_all();

  // There was one once, and it is to be plugged in again.
  void expect(const Cable& cable);

 private:
  enum class State { plugged, doubtful, missing, pulled };
  struct Known {
    Cable cable;
    State state = State::plugged;
  };
  std::vector<Known> known_;
};

}  // namespace ressort::devices
