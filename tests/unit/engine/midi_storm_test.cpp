// A million random MIDI messages of every kind and channel. Then all keys and pedals are lifted,
// and nothing sounds.
#include "app/realtime/midi.h"
#include "tests/support/player.h"

namespace ressort::midi_storm_test {
namespace {

using namespace support;
using Bytes = std::vector<std::uint8_t>;

// Generates MIDI messages with random data, in running status where possible. Half of them use few
// channels and keys, so that they interact.
class Storm {
 public:
  explicit Storm(std::uint64_t seed) : random_(seed) {}

  void add_message(Bytes& bytes) {
    constexpr std::uint8_t crowded[] = {0, 1, 14, 15};
    const auto channel = random_.below(2) == 0 ? crowded[random_.below(4)]
                                               : static_cast<std::uint8_t>(random_.below(16));
    const auto status = static_cast<std::uint8_t>(0x80 + 0x10 * random_.below(8));
    if (status == 0xf0) {
      return add_exclusive(bytes);
    }
    if (random_.below(64) == 0) {
      return add_zone(bytes);
    }
    const auto head = static_cast<std::uint8_t>(status | channel);
    if (head != running_ || random_.below(2) == 0) {
      bytes.push_back(head);
    }
    running_ = head;
    constexpr std::uint8_t meant[] = {0,  5,  6,  7,  10, 11,  38,  64,  64,  65,  66,  66,
                                      67, 68, 74, 96, 97, 100, 101, 120, 121, 123, 126, 127};
    const bool is_usual = random_.below(2) == 0;
    bytes.push_back(!is_usual        ? data()
                    : status == 0xb0 ? meant[random_.below(std::size(meant))]
                                     : static_cast<std::uint8_t>(60 + random_.below(6)));
    if (status != 0xc0 && status != 0xd0) {
      bytes.push_back(data());
    }
    if (random_.below(10) == 0) {
      bytes.push_back(0xf8);
    }
  }

 private:
  std::uint8_t data() { return static_cast<std::uint8_t>(random_.below(128)); }
  void add_zone(Bytes& bytes) {
    const std::uint8_t head = random_.below(2) == 0 ? 0xb0 : 0xbf;
    bytes.insert(bytes.end(),
                 {head, 101, 0, 100, 6, 6, static_cast<std::uint8_t>(random_.below(16))});
    running_ = head;
  }
  void add_exclusive(Bytes& bytes) {
    bytes.insert(bytes.end(), {0xf0, 0x7f, data(), 8, 2, 0, 1, data(), data(), data(), data()});
    if (random_.below(8) != 0) {
      bytes.push_back(0xf7);
    }
    running_ = 0;
  }

  Random random_;
  std::uint8_t running_ = 0;
};

}  // namespace

namespace {

// Releases everything as a player would: keys first, then pedals.
void end_all(Player& player) {
  std::vector<Event> end;
  for (std::uint8_t channel = 0; channel < 16; ++channel) {
    for (std::uint16_t key = 0; key < 128; ++key) {
      end.push_back({.kind = EventKind::note_off, .channel = channel, .index = key, .value = 0.5});
    }
    for (std::uint16_t pedal = 64; pedal <= 67; ++pedal) {
      end.push_back({.kind = EventKind::controller, .channel = channel, .index = pedal});
    }
    end.push_back({.kind = EventKind::controller, .channel = channel, .index = 123});
  }
  player.run(1000, end);
}

}  // namespace

TEST_CASE("a million messages leave no hanging note", "[midi_storm]") {
  for (const bool mono : {false, true}) {
    Preset preset = struck(6);
    preset.damper_s = 0.01;
    preset.damper_keys = {{36.0, 0.02}, {96.0, 0.005}};
    preset.mono = preset.legato = mono;
    preset.controls.push_back({.source = ControlSource::pressure, .target = "in2"});
    preset.controls.push_back({.source = ControlSource::controller, .number = 74, .target = "in2"});
    preset.controls.push_back({.target = "in2", .gesture = Gesture::hold, .turn = 2, .turns = 2});
    Player player(
        "@m mass 1. 0. 0.\n@g ground 0.\n@r springDamper @m @g 0.01 0.001\n"
        "@in1 frcInput @m\n@in2 posInput 0.\n@h springDamper @in2 @m 0.0001 0.\n"
        "@out1 posOutput @m\n",
        preset);
    Storm storm(mono ? 7 : 8);
    Random random(11);
    MidiReader reader;
    std::size_t count = 0;
    std::size_t notes = 0;
    int rounds = 0;
    const auto check_silence = [&] {
      end_all(player);
      // A voice that a controller woke sleeps again.
      for (int i = 0; i < 10 && player.engine().meters().stepped > 0; ++i) {
        player.run(10'000);
      }
      REQUIRE(player.engine().meters().stepped == 0);
      REQUIRE(player.y().back() == 0.0);
    };
    while (count < 500'000) {
      Bytes bytes;
      for (int i = 0; i < 2000; ++i) {
        storm.add_message(bytes);
      }
      std::vector<Event> events;
      for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t n = std::min<std::size_t>(bytes.size() - at, random.below(20));
        reader.read({bytes.data() + at, n}, [&](const Event& event) { events.push_back(event); });
        at += n;
      }
      for (std::size_t i = 0; i < events.size(); ++i) {
        events[i].frame = static_cast<std::uint32_t>(64 * i / events.size());
        notes += events[i].kind == EventKind::note_on ? 1 : 0;
      }
      count += events.size();
      player.out[0].clear();
      player.run(64, events, {64});
      REQUIRE(std::all_of(player.y().begin(), player.y().end(),
                          [](double y) { return std::isfinite(y); }));
      if (++rounds % 5 == 0) {
        check_silence();
      }
    }
    CHECK(notes > 10'000);
    CHECK(rounds > 200);
    CHECK(player.heap_calls == 0);
    check_silence();
    // The engine plays as before.
    player.run(2000, {{.kind = EventKind::controller, .index = 121},
                      {.kind = EventKind::controller, .index = 7, .value = 1.0},
                      note_on(1, 60)});
    CHECK(player.engine().meters().stepped == 1);
  }
}

}  // namespace ressort::midi_storm_test
