// Standard controllers on every channel, whatever the preset: MIDI 1.0 and General MIDI 2.
#include "core/engine/midi/channels.h"

#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::channels_test {
namespace {

using namespace support;

constexpr double rate_hz = 44100.0;

Event on(int channel, Event event) {
  event.channel = static_cast<std::uint8_t>(channel);
  return event;
}
Event bend(int channel, std::uint32_t frame, double value) {
  return on(channel, {.frame = frame, .kind = EventKind::bend, .value = value});
}
Event turned(int channel, std::uint32_t frame, int number, int value) {
  return on(channel, controller(frame, number, value / 127.0));
}

// Sends a registered parameter number with coarse and fine data.
std::vector<Event> registered(int channel, int parameter, int coarse, int fine) {
  return {turned(channel, 0, 101, 0), turned(channel, 0, 100, parameter),
          turned(channel, 0, 6, coarse), turned(channel, 0, 38, fine)};
}

std::vector<double> heard(const std::vector<Event>& events, std::size_t frames = 20000,
                          double damper_s = 0.0) {
  Preset preset = struck(4);
  preset.damper_s = damper_s;
  Player player(ringing_string(), preset);
  player.run(frames, events);
  CHECK(player.heap_calls == 0);
  return player.y();
}

// Returns the sound of a string that a controller tightens.
std::vector<double> tightened_by(int number, const std::vector<Event>& events) {
  const std::string text = scenes::string("s", 10, "0.1", "0.0005") + "@in1 frcInput @s_m2\n" +
                           scenes::output(1, "s_m6");
  Preset preset = struck(4);
  preset.parameters.push_back({.name = "s_K", .value = 0.1, .minimum = 0.1, .maximum = 0.2});
  preset.controls.push_back({.source = ControlSource::controller,
                             .number = number,
                             .target = "s_K",
                             .gesture = Gesture::parameter,
                             .low = 0.1,
                             .high = 0.2});
  Player player(text, preset);
  player.run(8000, events);
  CHECK(player.heap_calls == 0);
  return player.y();
}

// Returns the largest difference.
double apart(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    most = std::max(most, std::fabs(a[n] - b[n]));
  }
  return most;
}

// Returns the error of the pitch after bend events, in cents.
double off_by(std::vector<Event> events, double semitones) {
  events.push_back(note_on(0, 69));
  Player bent(scenes::poly_triangle(), struck(1));
  bent.run(8192, events);
  const double wanted_hz = 440.0 * std::exp2(semitones / 12.0);
  return 1200.0 * std::log2(measured_hz(bent.y(), rate_hz, wanted_hz) / wanted_hz);
}

}  // namespace

TEST_CASE("a bend bends its own channel by the bend range", "[channels]") {
  // A bend on another channel changes nothing.
  const std::vector<double> plain = heard({note_on(0, 60)});
  CHECK(apart(heard({bend(3, 0, 1.0), note_on(0, 60), bend(3, 5000, -1.0)}), plain) < 1e-12);
  CHECK(apart(heard({note_on(0, 60), bend(0, 5000, .5)}), plain) > .01);

  Channels channels;
  const auto enter = [&](int parameter, int coarse, int fine) {
    for (const Event& event : registered(0, parameter, coarse, fine)) {
      channels.turn(0, event.index, event.value);
    }
  };
  channels.bend(0, 1.0);
  CHECK(channels.semitones(0) == 2.0);
  enter(0, 12, 0);
  CHECK(channels.semitones(0) == 12.0);
  enter(0, 1, 50);
  CHECK(channels.semitones(0) == 1.5);
  channels.turn(0, 96, 1.0);  // one cent more
  CHECK(channels.semitones(0) == Approx(1.51));
  channels.bend(0, 0.0);
  enter(1, 96, 0);  // half a semitone up, in 8192 steps
  CHECK(channels.semitones(0) == .5);
  enter(2, 61, 0);
  CHECK(channels.semitones(0) == -2.5);
  // No parameter is selected now, so data entry has no effect, here and on other channels.
  channels.turn(0, 101, 1.0);
  channels.turn(0, 100, 1.0);
  channels.turn(0, 6, 1.0);
  channels.turn(0, 99, 0.0);
  channels.turn(0, 98, 0.0);
  channels.turn(0, 6, 1.0);
  CHECK(channels.semitones(0) == -2.5);
  CHECK(channels.semitones(1) == 0.0);
}

TEST_CASE("bend range and tuning change the pitch", "[channels]") {
  std::vector<Event> far = registered(0, 0, 7, 0);
  far.push_back(bend(0, 0, 1.0));
  CHECK(std::fabs(off_by(far, 7.0)) < 2.0);
  CHECK(std::fabs(off_by(registered(0, 1, 0, 0), -1.0)) < 2.0);
  CHECK(std::fabs(off_by(registered(0, 2, 69, 0), 5.0)) < 2.0);
  // The measurement distinguishes a semitone from two.
  CHECK(std::fabs(off_by(registered(0, 2, 69, 0), 4.8)) > 2.0);
}

TEST_CASE("volume and expression follow 40 dB a decade and ramp without a step", "[channels]") {
  const std::vector<double> plain = heard({note_on(0, 60)});
  CHECK(heard({turned(0, 0, 7, 100), note_on(0, 60)}) == plain);
  CHECK(apart(heard({turned(2, 0, 7, 0), note_on(0, 60), turned(2, 500, 11, 0)}), plain) < 1e-12);
  for (const auto& [number, value, gain] : {std::tuple{7, 50, .25}, std::tuple{7, 127, 1.6129},
                                            std::tuple{11, 127, 1.0}, std::tuple{11, 0, 0.0}}) {
    const std::vector<double> found = heard({note_on(0, 60), turned(0, 5000, number, value)});
    const double start = plain[100];
    REQUIRE(start != 0.0);
    double worst = 0.0;
    for (std::size_t n = 0; n < found.size(); ++n) {
      // The ramp is linear and takes 20 ms.
      const double way = std::clamp((static_cast<double>(n) - 4999.0) / 882.0, 0.0, 1.0);
      const double wanted = plain[n] * (1.0 + way * (gain - 1.0));
      worst = std::max(worst, std::fabs(found[n] - wanted));
    }
    CAPTURE(number, value);
    CHECK(worst < 1e-12);
  }
}

// A damper of 10 ms takes 120 dB in 882 samples, plus 221 samples to engage. The voice ends with
// its block of 64 samples.
constexpr double damped_after = 882 + 221 + 32;
TEST_CASE("pan balances left and right at equal power and ramps without a step", "[channels]") {
  // Both outputs read the same mass. Output 3 is on the left.
  const std::string stereo = ringing_string() + scenes::output(2, "s_m6") +
                             scenes::output(3, "s_m6") + scenes::output(4, "s_m6");
  const auto outputs = [&](const std::string& text, const std::vector<Event>& events) {
    Player player(text, struck(4));
    player.run(20000, events);
    CHECK(player.heap_calls == 0);
    return player.out;
  };
  const auto plain = outputs(stereo, {note_on(0, 60)});
  CHECK(outputs(stereo, {turned(0, 0, 10, 64), note_on(0, 60)}) == plain);
  // General MIDI 2: 1 is hard left, 127 hard right, with cosine and sine of a quarter turn.
  const double eighth = std::sin(0.125 * std::numbers::pi);
  const double other = std::cos(0.125 * std::numbers::pi);
  const double root = std::numbers::sqrt2;
  struct Row {
    double value;
    double left;
    double right;
  };
  for (const auto& [value, left, right] :
       {Row{1.0 / 127.0, root, 0.0}, Row{0.0, root, 0.0}, Row{1.0, 0.0, root},
        Row{32.5 / 127.0, root * other, root * eighth}}) {
    const auto found = outputs(stereo, {note_on(0, 60), on(0, controller(5000, 10, value))});
    double worst = 0.0;
    for (std::size_t n = 0; n < plain[0].size(); ++n) {
      const double way = std::clamp((static_cast<double>(n) - 4999.0) / 882.0, 0.0, 1.0);
      for (std::size_t channel = 0; channel < 4; ++channel) {
        const double gain = channel % 2 == 0 ? left : right;
        const double wanted = plain[channel][n] * (1.0 + way * (gain - 1.0));
        worst = std::max(worst, std::fabs(found[channel][n] - wanted));
      }
    }
    CAPTURE(value);
    CHECK(worst < 1e-12);
    CHECK(left * left + right * right == Approx(2.0));
  }
  // Pan applies to the notes of its channel, new ones included. A single output is not changed.
  CHECK(outputs(stereo, {turned(1, 0, 10, 0), note_on(0, 60)}) == plain);
  const auto right = outputs(stereo, {turned(0, 0, 10, 127), note_on(0, 60)});
  CHECK(peak(right[0]) == 0.0);
  CHECK(peak(right[1]) == Approx(root * peak(plain[1])));
  CHECK(outputs(ringing_string(), {turned(0, 0, 10, 0), note_on(0, 60)})[0] ==
        outputs(ringing_string(), {note_on(0, 60)})[0]);
}

TEST_CASE("the sostenuto pedal holds the keys that were down when it was pressed", "[channels]") {
  const auto ends = [](const std::vector<Event>& events) {
    const std::vector<double> y = heard(events, 20000, .01);
    std::size_t last = 0;
    for (std::size_t n = 0; n < y.size(); ++n) {
      last = y[n] != 0.0 ? n : last;
    }
    return last;
  };
  const int pedal = 66;
  CHECK(ends({note_on(0, 60), turned(0, 1000, pedal, 127), note_off(2000, 60),
              turned(0, 9000, pedal, 0)}) == Approx(9000 + damped_after).margin(33));
  // Later keys, and keys of another channel, are not held.
  CHECK(ends({turned(0, 0, pedal, 127), note_on(100, 60), note_off(2000, 60)}) ==
        Approx(2000 + damped_after).margin(33));
  CHECK(ends({note_on(0, 60), turned(5, 1000, pedal, 127), note_off(2000, 60)}) ==
        Approx(2000 + damped_after).margin(33));
  // If both pedals hold a note, the last pedal that is lifted releases it.
  CHECK(ends({note_on(0, 60), turned(0, 1000, pedal, 127), turned(0, 1500, 64, 127),
              note_off(2000, 60), turned(0, 5000, pedal, 0), turned(0, 8000, 64, 0)}) ==
        Approx(8000 + damped_after).margin(33));
  CHECK(ends({note_on(0, 60), turned(0, 1000, pedal, 127), turned(0, 1500, 64, 127),
              note_off(2000, 60), turned(0, 5000, 64, 0), turned(0, 8000, pedal, 0)}) ==
        Approx(8000 + damped_after).margin(33));
  // A key that is still down keeps its note.
  CHECK(ends({note_on(0, 60), turned(0, 1000, pedal, 127), turned(0, 5000, pedal, 0),
              note_off(7000, 60)}) == Approx(7000 + damped_after).margin(33));
}

TEST_CASE("channel modes end and reset their own channel as the standard says", "[channels]") {
  const auto other = on(1, note_on(0, 64));
  const std::vector<double> alone = heard({other});
  const auto equal_from = [&](const std::vector<double>& y, std::size_t from) {
    return std::equal(y.begin() + static_cast<std::ptrdiff_t>(from), y.end(),
                      alone.begin() + static_cast<std::ptrdiff_t>(from),
                      [](double a, double b) { return std::fabs(a - b) < 1e-12; });
  };
  // Mode 120 ends notes at once, whatever the pedal.
  CHECK(equal_from(heard({note_on(0, 60), other, turned(0, 500, 64, 127), turned(0, 3000, 120, 0)}),
                   3000 + 221));
  // Mode 123 releases keys as fingers would, so the pedal still holds them.
  CHECK(equal_from(heard({note_on(0, 60), other, turned(0, 3000, 123, 0)}, 20000, .01), 4168));
  CHECK(!equal_from(
      heard({note_on(0, 60), other, turned(0, 500, 64, 127), turned(0, 3000, 123, 0)}, 20000, .01),
      19000));
  CHECK(equal_from(heard({note_on(0, 60), other, turned(0, 500, 64, 127), turned(0, 3000, 123, 0),
                          turned(0, 6000, 64, 0)},
                         20000, .01),
                   7168));
  // Mode 121 resets bend, expression and pedals, but not the volume.
  CHECK(equal_from(heard({note_on(0, 60), other, turned(0, 500, 64, 127), note_off(1000, 60),
                          turned(0, 3000, 121, 0)},
                         20000, .01),
                   4168));
  Channels channels;
  channels.turn(0, 7, 50 / 127.0);
  channels.turn(0, 11, .5);
  channels.turn(0, 10, 1.0);
  channels.turn(0, 67, 1.0);
  channels.turn(0, 65, 1.0);
  channels.turn(0, 5, 1.0);
  channels.bend(0, 1.0);
  CHECK(channels.glide_s(0, 0.0) == 4.0);
  channels.reset(0);
  CHECK(channels.balance(0)[0] == Approx(0.0).margin(1e-12));  // RP-015 keeps the pan too
  CHECK(channels.softness(0) == 1.0);
  CHECK(channels.glide_s(0, 0.0) == 0.0);
  CHECK(channels.level(0) == Approx(.25));
  CHECK(channels.semitones(0) == 0.0);
}

TEST_CASE("RPN 5 sets the depth of the modulation wheel", "[channels]") {
  const auto played = [](std::vector<Event> events, const std::vector<Event>& more = {}) {
    events.insert(events.end(), more.begin(), more.end());
    events.push_back(note_on(0, 60));
    return tightened_by(1, events);
  };
  const auto wheel = [](double value) { return controller(0, 1, value); };
  const std::vector<double> down = played({});
  const std::vector<double> half = played({wheel(0.5)});
  const std::vector<double> full = played({wheel(1.0)});
  REQUIRE(apart(down, half) > 1e-3);
  REQUIRE(apart(half, full) > 1e-3);
  // General MIDI 2: the unit is 1/128 semitone, and the default is 64.
  CHECK(played(registered(0, 5, 0, 64), {wheel(0.5)}) == half);
  CHECK(played(registered(0, 5, 0, 32), {wheel(1.0)}) == half);
  CHECK(played(registered(0, 5, 1, 0), {wheel(0.5)}) == full);
  CHECK(played(registered(0, 5, 1, 0), {wheel(1.0)}) == full);  // the depth is clamped
  CHECK(played(registered(0, 5, 0, 0), {wheel(1.0)}) == down);
  CHECK(played(registered(3, 5, 0, 0), {wheel(1.0)}) == full);  // set on another channel
  // The depth also applies to a wheel that is already up. A reset moves the wheel, but keeps its
  // depth.
  CHECK(played({wheel(1.0)}, registered(0, 5, 0, 32)) == half);
  CHECK(played({wheel(1.0)}, {turned(0, 0, 121, 0)}) == down);
  std::vector<Event> reset = registered(0, 5, 0, 32);
  reset.push_back(turned(0, 0, 121, 0));
  CHECK(played(reset, {wheel(1.0)}) == half);
}

TEST_CASE("a reset and a panic lift the sustain pedal for the preset's controls", "[channels]") {
  const auto played = [](std::vector<Event> events) {
    events.push_back(note_on(0, 60));
    return tightened_by(64, events);
  };
  const std::vector<double> up = played({});
  REQUIRE(apart(up, played({turned(0, 0, 64, 127)})) > 1e-3);
  CHECK(played({turned(0, 0, 64, 127), turned(0, 0, 121, 0)}) == up);
  CHECK(played({turned(3, 0, 64, 127), {.kind = EventKind::panic}}) == up);
  // A pedal that is up moves nothing: the parameter keeps what another source has set.
  const std::vector<double> set = played({parameter(0, 0, 0.2)});
  CHECK(played({parameter(0, 0, 0.2), turned(0, 0, 121, 0)}) == set);
}

TEST_CASE("the soft pedal softens notes that are struck while it is down", "[channels]") {
  const std::vector<double> plain = heard({note_on(0, 60)});
  const std::vector<double> soft = heard({turned(0, 0, 67, 127), note_on(0, 60)});
  CHECK(peak(soft) == Approx(.75 * peak(plain)).epsilon(1e-9));
  CHECK(heard({turned(4, 0, 67, 127), note_on(0, 60)}) == plain);
}

}  // namespace ressort::channels_test
