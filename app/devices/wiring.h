// app/devices: remembers the connections of a device's ports by name, to restore them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::devices {

// A connection of one of our ports, in either direction.
struct Cable {
  std::string ours;    // short name, because the client's name may change
  std::string theirs;  // "client:port"
  bool operator==(const Cable&) const = default;
};

// Remembers every connection until a person removes it. Connections lost with their port or server
// are missing until they can be restored. [control]
class Wiring {
 public:
  static constexpr std::size_t most_cables = 1024;  // then the oldest are forgotten

  // Updates the states from all present connections. A connection that is gone was removed by a
  // person if its other port still exists at a later update without changes (`is_quiet`): a closing
  // client loses its connections first and its ports afterwards.
  void update(const std::vector<Cable>& present,
              const std::function<bool(const std::string& port)>& exists, bool is_quiet);

  // Returns true if a connection is gone and a later update will show why.
  bool is_in_doubt() const;

  // Returns the connections to restore once both ports exist.
  std::vector<Cable> missing() const;

  // Returns true if this connection has ever been made.
  bool knows(const Cable& cable) const;

  // Marks all connections of this port as missing, even if the port has come back meanwhile.
  void mark_missing(const std::string& theirs);
  // Marks all connections as missing, because the device is gone.
  void mark_all_missing();

  // Adds a connection to restore.
  void add_missing(const Cable& cable);

 private:
  enum class State { plugged, doubtful, missing, pulled };
  struct Known {
    Cable cable;
    State state = State::plugged;
  };
  std::vector<Known> known_;
};

}  // namespace ressort::devices
