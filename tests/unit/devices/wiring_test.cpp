// Connections of a device's ports: remembered by name until a person removes them.
#include "app/devices/wiring.h"

#include <set>

#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::wiring_test {
namespace {

const Cable speaker{"out_left", "system:playback_1"};
const Cable mixer{"out_left", "mixer:in"};
const Cable keyboard{"midi_in", "keys:out"};

using Ports = std::set<std::string>;

void look(Wiring& wiring, const std::vector<Cable>& present, const Ports& ports,
          bool is_quiet = true) {
  wiring.update(
      present, [&](const std::string& port) { return ports.count(port) > 0; }, is_quiet);
}

const Ports all{speaker.theirs, mixer.theirs, keyboard.theirs};

}  // namespace

TEST_CASE("all connections are missing after the device is lost, until they are restored",
          "[wiring]") {
  Wiring wiring;
  look(wiring, {speaker, mixer, keyboard}, all);
  CHECK(wiring.missing().empty());
  wiring.mark_all_missing();
  CHECK(wiring.missing() == std::vector<Cable>{speaker, mixer, keyboard});
  look(wiring, {}, {});
  look(wiring, {speaker}, {speaker.theirs});
  CHECK(wiring.missing() == std::vector<Cable>{mixer, keyboard});
  wiring.mark_all_missing();  // once more, before all were restored
  CHECK(wiring.missing() == std::vector<Cable>{speaker, mixer, keyboard});
}

TEST_CASE("a removed connection stays removed until a person makes it again", "[wiring]") {
  Wiring wiring;
  look(wiring, {speaker, mixer}, all);
  look(wiring, {speaker}, all);
  CHECK(wiring.is_in_doubt());
  look(wiring, {speaker}, all);
  CHECK_FALSE(wiring.is_in_doubt());
  wiring.mark_all_missing();
  CHECK(wiring.missing() == std::vector<Cable>{speaker});
  CHECK(wiring.knows(mixer));  // so that the program does not reconnect it
  CHECK_FALSE(wiring.knows(keyboard));
  look(wiring, {speaker, mixer}, all);
  wiring.mark_all_missing();
  CHECK(wiring.missing() == std::vector<Cable>{speaker, mixer});
}

TEST_CASE("a closing client loses its connections first, which does not count as removal",
          "[wiring]") {
  Wiring wiring;
  look(wiring, {speaker, mixer}, all);
  look(wiring, {speaker}, all);         // after its connections and before its ports
  look(wiring, {speaker}, all, false);  // again, because another connection changed
  CHECK(wiring.is_in_doubt());
  look(wiring, {speaker}, {speaker.theirs});
  CHECK(wiring.missing() == std::vector<Cable>{mixer});
  look(wiring, {speaker}, all);  // it is back, not yet connected
  CHECK(wiring.missing() == std::vector<Cable>{mixer});
  look(wiring, {speaker, mixer}, all);
  CHECK(wiring.missing().empty());
}

TEST_CASE("a port that returns between two updates was not disconnected", "[wiring]") {
  Wiring wiring;
  look(wiring, {speaker, mixer, keyboard}, all);
  wiring.mark_missing(keyboard.theirs);
  look(wiring, {speaker}, all);  // it is back, and the mixer was removed meanwhile
  CHECK(wiring.missing() == std::vector<Cable>{keyboard});
  CHECK(wiring.is_in_doubt());
  look(wiring, {speaker}, all);
  CHECK(wiring.missing() == std::vector<Cable>{keyboard});
  look(wiring, {speaker, keyboard}, all);
  CHECK(wiring.missing().empty());
  // Reported only after it was seen to be unplugged.
  look(wiring, {speaker}, all);
  wiring.mark_missing(keyboard.theirs);
  look(wiring, {speaker}, all);
  CHECK(wiring.missing() == std::vector<Cable>{keyboard});
  wiring.mark_missing(mixer.theirs);  // removed by a person
  CHECK(wiring.missing() == std::vector<Cable>{keyboard});
}

}  // namespace ressort::wiring_test
