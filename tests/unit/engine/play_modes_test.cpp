// The assignment of voices to keys: poly, mono, legato, pedals and glides. The cases are those that
// any voice manager must handle.
#include "core/engine/keyboard.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::play_modes_test {
namespace {

using namespace support;

constexpr double rate_hz = 44100.0;
constexpr double highest = 1e9;

// A keyboard whose released voices ring on, and the calls that an engine makes for keys and pedals.
struct Keys {
  explicit Keys(int count, bool mono = false, bool legato = false, double glide_s = 0.0,
                Gesture gesture = Gesture::impulse) {
    playing.controls.push_back({.source = Source::note, .gesture = gesture});
    playing.tuning = Tuning::keyboard;
    playing.voices = count;
    playing.mono = mono;
    playing.legato = legato;
    playing.glide_s = glide_s;
    keyboard.emplace(playing, rate_hz, std::size_t{2});
  }
  Press on(int key, int channel = 0) {
    return keyboard->press_key(key, 0.8, static_cast<std::uint8_t>(channel), highest);
  }
  // Releases a key. Returns the held key to which the voice returns.
  std::optional<int> off(int key, int channel = 0) {
    if (const auto earlier =
            keyboard->return_to_held_key(key, static_cast<std::uint8_t>(channel), highest)) {
      return earlier->key;
    }
    for (Voice& voice : keyboard->voices) {
      if (keyboard->release_key(voice, key, static_cast<std::uint8_t>(channel),
                                usual_release_velocity)) {
        keyboard->release(voice);
      }
    }
    return std::nullopt;
  }
  void pedal(bool is_down, int channel = 0) {
    keyboard->turn_controller(static_cast<std::uint8_t>(channel), 64, is_down ? 1.0 : 0.0);
    for (Voice& voice : keyboard->voices) {
      if (keyboard->is_released_by_pedal(voice, static_cast<std::uint8_t>(channel))) {
        keyboard->release(voice);
      }
    }
  }
  const Voice& latest() const { return keyboard->voices[keyboard->voices.latest()]; }
  template <class Wanted>
  int count(Wanted&& wanted) const {
    int found = 0;
    for (std::size_t lane = 0; lane < keyboard->voices.size(); ++lane) {
      const Voice& voice = keyboard->voices[lane];
      found += voice.is_live() && voice.has_key && wanted(voice) ? 1 : 0;
    }
    return found;
  }
  int live() const {
    return count([](const Voice&) { return true; });
  }
  int gated() const {
    return count([](const Voice& voice) { return voice.held; });
  }
  // The voices that no later key has ended.
  int lasting() const {
    return count([](const Voice& voice) { return !voice.is_replaced; });
  }
  int sounding() const {
    return count([](const Voice& voice) { return voice.held || voice.sustained; });
  }
  int on_key(int key) const {
    return count([&](const Voice& voice) { return voice.key == key; });
  }

  Playing playing;
  std::optional<Keyboard> keyboard;
};

}  // namespace

TEST_CASE("each key has its own voice, separately for each channel", "[play_modes]") {
  Keys keys(8);
  CHECK(keys.on(60) == Press::starts);
  CHECK(keys.on(64) == Press::starts);
  CHECK((keys.live() == 2 && keys.gated() == 2));
  CHECK(keys.on(60, 1) == Press::starts);
  CHECK((keys.live() == 3 && keys.on_key(60) == 2));
  keys.off(60, 1);
  CHECK(keys.gated() == 2);
  keys.off(60, 5);  // matches no voice
  keys.off(61);
  CHECK(keys.gated() == 2);
  keys.off(60);
  keys.off(64);
  CHECK((keys.gated() == 0 && keys.live() == 3));  // and all of them ring on
}

TEST_CASE("a repeated key takes the place of its own voice", "[play_modes]") {
  Keys keys(4);
  for (const int key : {60, 61, 62, 63}) {
    keys.on(key);
  }
  keys.off(60);
  CHECK((keys.live() == 4 && keys.gated() == 3));
  // No other voice is stolen even if all are in use.
  CHECK(keys.on(60) == Press::starts);
  CHECK((keys.live() == 4 && keys.gated() == 4));
  for (const int key : {60, 61, 62, 63}) {
    CHECK(keys.on_key(key) == 1);
  }
  // A new key steals exactly one voice.
  CHECK(keys.on(64) == Press::starts);
  CHECK((keys.live() == 4 && keys.on_key(64) == 1));
}

TEST_CASE("the sustain pedal holds notes, repeated or not, until it is lifted", "[play_modes]") {
  Keys keys(8);
  keys.on(60);
  keys.on(64);
  keys.pedal(true);
  keys.off(60);
  CHECK((keys.gated() == 1 && keys.sounding() == 2));
  keys.pedal(false);
  CHECK(keys.sounding() == 1);  // 64 is still down
  keys.off(64);
  CHECK(keys.sounding() == 0);
  // A key repeated and released under the pedal...
  keys.pedal(true);
  keys.on(60);
  keys.off(60);
  CHECK(keys.on(60) == Press::starts);
  keys.off(60);
  CHECK(keys.sounding() == 1);
  keys.pedal(false);
  CHECK(keys.sounding() == 0);
  // ...or released after it.
  keys.pedal(true);
  keys.on(60);
  keys.off(60);
  keys.on(60);
  keys.pedal(false);
  CHECK(keys.sounding() == 1);
  keys.off(60);
  CHECK(keys.sounding() == 0);
  // A pedal on another channel has no effect.
  keys.pedal(true, 3);
  keys.on(60);
  keys.off(60);
  CHECK(keys.sounding() == 0);
}

// A key is struck on a voice of its own, which has a hammer at rest and the key's parameters, and
// the voice of the key before it is damped.
TEST_CASE("mono plays the latest held key only", "[play_modes]") {
  Keys keys(8, true);
  CHECK(keys.on(60) == Press::starts);
  CHECK(keys.on(64) == Press::starts);
  CHECK((keys.lasting() == 1 && keys.latest().key == 64));
  CHECK(keys.on(67) == Press::starts);
  CHECK(keys.off(64) == std::nullopt);  // not the sounding key
  CHECK((keys.gated() == 1 && keys.lasting() == 1 && keys.latest().key == 67));
  CHECK(keys.off(67) == 60);
  CHECK((keys.gated() == 1 && keys.lasting() == 1 && keys.latest().key == 60));
  CHECK(keys.latest().is_new);
  CHECK(keys.off(60) == std::nullopt);
  CHECK((keys.gated() == 0 && keys.lasting() == 1));
  // A ringing voice ends with the next key.
  CHECK(keys.on(62) == Press::starts);
  CHECK((keys.lasting() == 1 && keys.latest().key == 62));
  // Each channel has its own voice.
  CHECK(keys.on(62, 1) == Press::starts);
  CHECK(keys.lasting() == 2);
  CHECK(keys.off(62, 1) == std::nullopt);
  CHECK(keys.gated() == 1);
  // One release is enough for two presses of the same key.
  keys.on(62);
  keys.on(62);
  keys.off(62);
  CHECK(keys.gated() == 0);
}

TEST_CASE("in mono a pedal holds the sound, and keys set its pitch", "[play_modes]") {
  Keys keys(8, true);
  keys.pedal(true);
  keys.on(60);
  keys.on(64);
  CHECK(keys.off(64) == 60);
  keys.off(60);
  CHECK((keys.lasting() == 1 && keys.sounding() == 1 && keys.latest().key == 60));
  keys.on(67);
  CHECK((keys.lasting() == 1 && keys.sounding() == 1 && keys.latest().key == 67));
  keys.off(67);
  keys.pedal(false);
  CHECK(keys.sounding() == 0);
}

TEST_CASE("a legato voice keeps the key that was struck", "[play_modes]") {
  const bool legato = GENERATE(false, true);
  Keys keys(8, true, legato);
  keys.on(45);
  REQUIRE(keys.latest().struck_key == 45);
  keys.on(46);
  CHECK(keys.latest().key == 46);
  CHECK(keys.latest().struck_key == (legato ? 45 : 46));
  keys.off(46);
  CHECK(keys.latest().key == 45);
  CHECK(keys.latest().struck_key == 45);
}

TEST_CASE("legato moves without a new blow while a key is down", "[play_modes]") {
  Keys keys(8, true, true);
  CHECK(keys.on(60) == Press::starts);
  CHECK(keys.on(62) == Press::moves);
  CHECK((keys.live() == 1 && keys.on_key(62) == 1));
  CHECK(keys.off(60) == std::nullopt);
  CHECK(keys.gated() == 1);
  CHECK(keys.off(62) == std::nullopt);
  CHECK(keys.gated() == 0);
  CHECK(keys.on(64) == Press::starts);
  CHECK(keys.lasting() == 1);
  CHECK(keys.on(65) == Press::moves);
  CHECK(keys.off(65) == 64);
  CHECK(keys.off(64) == std::nullopt);
  // The legato switch works on a mono channel, separately for each channel.
  Keys switched(8, true);
  switched.keyboard->turn_controller(0, 68, 1.0);
  switched.on(60);
  CHECK(switched.on(62) == Press::moves);
  switched.on(60, 1);
  CHECK(switched.on(62, 1) == Press::starts);
}

// A softer blow lets the harder one before it ring on, on a voice of its own.
TEST_CASE("a key of a mono channel ends both voices of a key that was struck twice",
          "[play_modes]") {
  const bool legato = GENERATE(false, true);
  Keys keys(8, true, legato);
  const auto strike = [&](int key, double velocity) {
    keys.keyboard->press_key(key, velocity, 0, highest);
    keys.keyboard->set_velocity(keys.keyboard->voices[keys.keyboard->voices.latest()], velocity);
  };
  strike(60, 0.9);
  keys.off(60);
  strike(60, 0.3);
  CHECK((keys.lasting() == 2 && keys.gated() == 2));
  strike(64, 0.5);
  CHECK((keys.lasting() == 1 && keys.gated() == 1 && keys.latest().key == 64));
  CHECK(keys.off(64) == 60);
  CHECK((keys.lasting() == 1 && keys.gated() == 1 && keys.latest().key == 60));
  if (!legato) {  // the legato pedal goes down between the blows and the return to key 60
    strike(64, 0.9);
    strike(64, 0.3);
    CHECK((keys.lasting() == 2 && keys.gated() == 2));
    keys.keyboard->turn_controller(0, 68, 1.0);
    CHECK(keys.off(64) == 60);
    CHECK((keys.lasting() == 1 && keys.gated() == 1 && keys.latest().key == 60));
  }
}

TEST_CASE("a pedal does not catch a damped voice that a mono channel has left", "[play_modes]") {
  const bool is_caught_before = GENERATE(false, true);
  Keys keys(8, true);
  keys.playing.damper_s = 1.0;
  keys.on(60);
  keys.off(60);
  for (int block = 0; block < 200; ++block) {
    keys.keyboard->voices.advance_gains(max_block_frames);
  }
  REQUIRE(!keys.latest().is_undamped());
  keys.pedal(is_caught_before);
  keys.on(64);
  keys.pedal(true);
  CHECK((keys.lasting() == 1 && keys.latest().key == 64));
  const Voice& before = keys.keyboard->voices[0];
  CHECK((before.key == 60 && before.decay.kept_goal < 1.0));
}

TEST_CASE("channel modes select mono and poly regardless of the preset", "[play_modes]") {
  Keys keys(8);
  keys.keyboard->set_mono(2, true);
  keys.on(60, 2);
  keys.on(64, 2);
  CHECK(keys.lasting() == 1);
  keys.on(60);
  CHECK(keys.on(64) == Press::starts);
  Keys mono(8, true);
  mono.keyboard->set_mono(0, false);
  mono.on(60);
  CHECK(mono.on(64) == Press::starts);
  CHECK(mono.lasting() == 2);
}

TEST_CASE("a bow plays on in the mono voice", "[play_modes]") {
  Keys keys(8, true, false, 0.0, Gesture::bow);
  CHECK(keys.on(60) == Press::starts);
  CHECK(keys.on(64) == Press::strikes);
  CHECK((keys.live() == 1 && keys.on_key(64) == 1));
  CHECK(keys.off(64) == 60);
  CHECK((keys.live() == 1 && keys.on_key(60) == 1 && !keys.latest().is_replaced));
}

TEST_CASE("a glide takes its time and ends on the pitch", "[play_modes]") {
  constexpr double glide_s = 0.1;
  const auto updates = static_cast<int>(glide_s * rate_hz / max_block_frames);
  Keys keys(8, true, true, glide_s);
  keys.on(60);
  keys.on(72);
  const Voice& voice = keys.latest();
  CHECK(voice.glide == Approx(-12.0).epsilon(1e-12));
  for (int i = 0; i < updates / 2; ++i) {
    keys.keyboard->voices.advance_glides();
  }
  CHECK(voice.glide == Approx(-6.0).margin(12.0 / updates));
  // It can turn back halfway.
  keys.off(72);
  CHECK(voice.glide == Approx(6.0).margin(12.0 / updates));
  for (int i = 0; i <= updates; ++i) {
    keys.keyboard->voices.advance_glides();
  }
  CHECK(voice.glide == 0.0);
  CHECK(voice.frequency_hz == Approx(261.6255653005986).epsilon(1e-12));
  // Legato glides only if keys overlap. Poly glides from the previous key of its own channel.
  keys.off(60);
  keys.on(67);
  CHECK(keys.latest().glide == 0.0);
  Keys poly(8, false, false, glide_s);
  poly.on(60);
  CHECK(poly.latest().glide == 0.0);
  poly.on(67);
  CHECK(poly.latest().glide == Approx(-7.0));
  poly.on(67, 1);
  CHECK(poly.latest().glide == 0.0);
  // Controller 65 switches it off, and controller 5 sets the time: a quarter of 4 s at half its
  // range.
  poly.keyboard->turn_controller(0, 65, 0.0);
  poly.on(70);
  CHECK(poly.latest().glide == 0.0);
  poly.keyboard->turn_controller(0, 65, 1.0);
  poly.keyboard->turn_controller(0, 5, 0.5);
  poly.on(71);
  const Voice& slow = poly.latest();
  CHECK(slow.glide_step == Approx(1.0 * max_block_frames / rate_hz).epsilon(1e-9));
}

TEST_CASE("a struck mono key glides from the pitch that sounds", "[play_modes]") {
  constexpr double glide_s = 0.1;
  const auto updates = static_cast<int>(glide_s * rate_hz / max_block_frames);
  const auto wait_half = [&](Keys& keys) {
    for (int i = 0; i < updates / 2; ++i) {
      keys.keyboard->voices.advance_glides();
    }
  };
  Keys keys(8, true, false, glide_s);
  keys.on(60);
  keys.on(72);
  CHECK(keys.latest().glide == Approx(-12.0));
  wait_half(keys);
  keys.on(66);
  CHECK(keys.latest().glide == Approx(0.0).margin(12.0 / updates));
  keys.on(78);
  wait_half(keys);
  CHECK(keys.off(78) == 66);
  CHECK(keys.latest().glide == Approx(6.0).margin(12.0 / updates));
}

TEST_CASE("a mono channel returns to a key at the frequency of its note", "[play_modes]") {
  Keys keys(8, true);
  keys.keyboard->press_key(60, 0.8, 0, highest, 300.0);
  keys.on(64);
  CHECK(keys.off(64) == 60);
  CHECK(keys.latest().frequency_hz == Approx(300.0));
  keys.keyboard->retune_key(60, 270.0, true, highest);  // for notes at the key's frequency
  CHECK(keys.latest().frequency_hz == Approx(300.0));
}

TEST_CASE("a glide is audible, and a mono key is struck or moves the voice", "[play_modes]") {
  const auto played = [](bool legato, double glide_s) {
    Preset preset = struck(4);
    preset.mono = true;
    preset.legato = legato;
    preset.glide_s = glide_s;
    Player player(scenes::poly_triangle(), preset);
    player.run(16384, {note_on(0, 69), note_on(4096, 72), note_off(4100, 69)});
    CHECK(player.heap_calls == 0);
    return player.y();
  };
  const auto later = [](const std::vector<double>& y) {
    return std::vector<double>(y.begin() + 8192, y.end());
  };
  const double c_hz = 440.0 * std::exp2(3.0 / 12.0);
  for (const double glide_s : {0.0, 0.05}) {
    const auto struck_again = played(false, glide_s);
    const auto moved = played(true, glide_s);
    CHECK(std::fabs(1200.0 * std::log2(measured_hz(later(moved), rate_hz, c_hz) / c_hz)) < 2.0);
    CHECK(peak(later(struck_again)) > 2.0 * peak(later(moved)));
  }
}

TEST_CASE("channels that a preset does not listen to play nothing", "[play_modes]") {
  const auto played = [](int channel, unsigned channels) {
    Preset preset = struck(4);
    preset.channels = channels;
    Player player(ringing_string(), preset);
    Event note = note_on(100, 60);
    note.channel = static_cast<std::uint8_t>(channel);
    player.run(3000, {note});
    return peak(player.y());
  };
  CHECK(played(3, 0xffff) > 1e-3);
  CHECK(played(3, 0x0008) > 1e-3);
  CHECK(played(3, 0x0007) == 0.0);
  CHECK(played(0, 0x0008) == 0.0);
}

TEST_CASE("a velocity curve shapes the touch and keeps its end points", "[play_modes]") {
  const auto loudness = [](double curve, double velocity,
                           std::vector<std::array<double, 2>> points = {}, bool is_soft = false) {
    Preset preset = struck(4);
    preset.velocity = curve;
    preset.velocity_points = std::move(points);
    Player player(ringing_string(), preset);
    player.run(3000, {{.kind = EventKind::controller, .index = 67, .value = is_soft ? 1.0 : 0.0},
                      note_on(0, 60, velocity)});
    return peak(player.y());
  };
  const double full = loudness(0.0, 1.0);
  // The blow is proportional to the curve's value: v, its square root, its square.
  CHECK(loudness(0.0, 0.25) == Approx(0.25 * full));
  CHECK(loudness(0.5, 0.25) == Approx(0.5 * full));
  CHECK(loudness(-0.5, 0.25) == Approx(0.0625 * full));
  CHECK(loudness(1.0, 1.0) == Approx(full));
  CHECK(loudness(-1.0, 1.0) == Approx(full));
  const std::vector<std::array<double, 2>> points = {{0.0, 0.2}, {0.5, 0.4}, {1.0, 0.8}};
  CHECK(loudness(0.0, 0.25, points) == Approx(0.3 * full));
  CHECK(loudness(0.0, 0.75, points) == Approx(0.6 * full));
  CHECK(loudness(0.0, 1.0, points) == Approx(0.8 * full));
  // The soft pedal scales the velocity, not the curve's value: 0.6^2 and not 0.75 0.8^2.
  CHECK(loudness(-0.5, 0.8, {}, true) == Approx(0.36 * full));
  CHECK(loudness(0.0, 1.0, points, true) == Approx(0.6 * full));
}

TEST_CASE("tuning points by key compensate a sound that is flat of its mode", "[play_modes]") {
  Preset preset = struck(1);
  preset.transpose = -12;
  preset.flattening_cents = {{60.0, 10.0}, {72.0, 40.0}};
  for (const auto& [key, cents] :
       {std::pair(48, 10.0), {60, 10.0}, {64, 20.0}, {69, 32.5}, {72, 40.0}, {84, 40.0}}) {
    Player player(ringing_string(), preset);
    player.run(60000, {note_on(0, key)});
    const double wanted_hz = 440.0 * std::exp2((key - 81) / 12.0 + cents / 1200.0);
    const std::span<const double> late = std::span(player.y()).subspan(10000);
    CAPTURE(key);
    CHECK(1200.0 * std::log2(measured_hz(late, rate_hz, wanted_hz) / wanted_hz) ==
          Approx(0.0).margin(0.02));
  }
}

}  // namespace ressort::play_modes_test
