#include "app/devices/wiring.h"

#include <algorithm>

namespace ressort::devices {

void Wiring::update(const std::vector<Cable>& present,
                    const std::function<bool(const std::string& port)>& exists, bool is_quiet) {
  for (Known& known : known_) {
    const bool is_there = std::ranges::find(present, known.cable) != present.end();
    if (is_there) {
      known.state = State::plugged;
    } else if (known.state == State::plugged) {
      known.state = State::doubtful;
    } else if (known.state == State::doubtful && is_quiet) {
      known.state = exists(known.cable.theirs) ? State::pulled : State::missing;
    }
  }
  for (const Cable& cable : present) {
    if (!knows(cable)) {
      known_.push_back({cable});
    }
  }
  if (known_.size() > most_cables) {
    known_.erase(known_.begin(), known_.end() - most_cables);
  }
}

bool Wiring::is_in_doubt() const {
  return std::ranges::any_of(known_,
                             [](const Known& known) { return known.state == State::doubtful; });
}

std::vector<Cable> Wiring::missing() const {
  std::vector<Cable> cables;
  for (const Known& known : known_) {
    if (known.state == State::missing) {
      cables.push_back(known.cable);
    }
  }
  return cables;
}

bool Wiring::knows(const Cable& cable) const {
  return std::ranges::any_of(known_, [&](const Known& known) { return known.cable == cable; });
}

void Wiring::mark_missing(const std::string& theirs) {
  for (Known& known : known_) {
    if (known.cable.theirs == theirs && known.state != State::pulled) {
      known.state = State::missing;
    }
  }
}

void Wiring::mark_all_missing() {
  for (Known& known : known_) {
    if (known.state != State::pulled) {
      known.state = State::missing;
    }
  }
}

void Wiring::add_missing(const Cable& cable) {
  if (!knows(cable)) {
    known_.push_back({cable, State::missing});
  }
}

}  // namespace ressort::devices
