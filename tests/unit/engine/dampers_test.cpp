// Properties of a note besides its pitch: loudness, brightness and the action of its damper.
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/engine/dc_blocker.h"
#include "tests/support/catch.h"
#include "tests/support/player.h"

namespace ressort::dampers_test {
namespace {

using support::controller;
using support::note_off;
using support::note_on;
using support::peak;
using support::Player;
using support::ringing_string;
using support::struck;

// Returns the T60 in seconds, from the ratio of a damped to a held note at two times.
double t60_s(const Player& player, const Player& held, std::size_t from, std::size_t to) {
  // Compares where the held note is loud, because the ratio is most accurate there.
  const auto loud = [&](std::size_t at) {
    const auto first = held.y().begin() + static_cast<std::ptrdiff_t>(at);
    const auto most = std::max_element(
        first, first + 400, [](double a, double b) { return std::fabs(a) < std::fabs(b); });
    return static_cast<std::size_t>(most - held.y().begin());
  };
  const std::size_t early = loud(from);
  const std::size_t late = loud(to);
  const auto left = [&](std::size_t at) { return player.y()[at] / held.y()[at]; };
  return 3.0 * static_cast<double>(late - early) / 44100.0 / std::log10(left(early) / left(late));
}

Preset damped(double seconds, int voices = 1) {
  Preset preset = struck(voices);
  preset.damper_s = seconds;
  return preset;
}

TEST_CASE("a key released fast is damped fast", "[dampers]") {
  Player held(ringing_string(), damped(0.4));
  held.run(30000, {note_on(0, 60)});
  for (const auto& [velocity, factor] :
       {std::pair(0.0, 4.0), std::pair(0.5, 1.0), std::pair(1.0, 0.25)}) {
    Player player(ringing_string(), damped(0.4));
    player.run(30000, {note_on(0, 60), note_off(2000, 60, velocity)});
    CHECK(t60_s(player, held, 4000, 6000) == Approx(0.4 * factor).epsilon(1e-3));
  }
}

TEST_CASE("a half pedal damps lightly", "[dampers]") {
  Player held(ringing_string(), damped(0.2));
  held.run(30000, {note_on(0, 60)});
  // The damper lies fully up to a quarter of the pedal's travel, is off from the half on, and has a
  // square law between.
  for (const auto& [pedal, share] : {std::pair(0.0, 1.0), std::pair(0.25, 1.0),
                                     std::pair(0.375, 0.25), std::pair(0.4375, 0.0625)}) {
    Player player(ringing_string(), damped(0.2));
    player.run(30000, {note_on(0, 60), controller(500, 64, pedal), note_off(2000, 60)});
    INFO(pedal);
    CHECK(t60_s(player, held, 4000, 6000) == Approx(0.2 / share).epsilon(1e-3));
  }
  // 64 of 127 is down, also for a switch that sends no more.
  Player off(ringing_string(), damped(0.2));
  off.run(30000, {note_on(0, 60), controller(500, 64, 64 / 127.0), note_off(2000, 60)});
  CHECK(off.y() == held.y());
  // A pedal pressed late catches the rest of the note, which rings on.
  Player caught(ringing_string(), damped(0.2));
  caught.run(30000, {note_on(0, 60), note_off(2000, 60), controller(5000, 64, 1.0)});
  const double left = caught.y()[20000] / held.y()[20000];
  CHECK(left < 0.2);
  CHECK(left > 0.02);
  CHECK(caught.y()[29000] == Approx(left * held.y()[29000]).epsilon(1e-9));
}

TEST_CASE("a damped key starts a new voice beside the old one", "[dampers]") {
  Player first(ringing_string(), damped(0.2, 2));
  first.run(20000, {note_on(0, 60), note_off(2000, 60, usual_release_velocity)});
  Player fresh(ringing_string(), damped(0.2, 2));
  fresh.run(10000, {note_on(0, 60)});
  Player both(ringing_string(), damped(0.2, 2));
  both.run(20000, {note_on(0, 60), note_off(2000, 60, usual_release_velocity), note_on(10000, 60)});
  for (std::size_t n = 0; n < 10000; ++n) {
    REQUIRE(std::fabs(both.y()[10000 + n] - first.y()[10000 + n] - fresh.y()[n]) < 1e-12);
  }
}

TEST_CASE("a live pluck without a key is damped when the last key is released", "[dampers]") {
  const std::string plucked = scenes::string("s", 10, "0.1", "0.0005") +
                              "@in1 posInput 0.\n@p nlPluck @in1 @s_m2 0.1 0.01\n" +
                              scenes::output(1, "s_m6");
  Preset preset;
  preset.voices = 3;
  preset.damper_s = 0.2;
  preset.controls.push_back({.source = ControlSource::controller,
                             .number = 1,
                             .target = "in1",
                             .gesture = Gesture::position,
                             .low = 0.0,
                             .high = 0.1});
  const auto left = [&](const std::vector<Event>& events) {
    Player player(plucked, preset);
    player.run(44100, events);
    return peak(std::span(player.y()).last(4000)) / peak(std::span(player.y()).first(9000));
  };
  // The keys play nothing themselves, so only the pluck is audible.
  const Event swept = controller(0, 1, 1.0);
  const double rings = left({swept});
  CHECK(rings > 0.1);
  CHECK(left({swept, note_on(9000, 60)}) == Approx(rings).epsilon(1e-3));
  CHECK(left({swept, note_on(9000, 60), note_on(9000, 62), note_off(15000, 60)}) ==
        Approx(rings).epsilon(1e-3));
  CHECK(left({swept, controller(0, 64, 1.0), note_on(9000, 60), note_off(15000, 60)}) ==
        Approx(rings).epsilon(1e-3));
  // The decay in 25 100 frames at a T60 of 8820 frames is 171 dB. A voice ends at -120 dB.
  CHECK(left({swept, note_on(9000, 60), note_off(15000, 60)}) < 1e-5);
  CHECK(left({swept, note_on(9000, 60), note_on(9000, 62), note_off(15000, 60),
              note_off(15000, 62)}) < 1e-5);
}

TEST_CASE("a fully damped note ends", "[dampers]") {
  Player player(ringing_string(), damped(0.1, 4));
  player.run(44100, {note_on(0, 60), note_on(0, 64), note_off(100, 60), note_off(100, 64)});
  CHECK(player.engine().meters().stepped == 0);
}

TEST_CASE(
    "keys_db changes the gain of a key, at once if it is struck and in 20 ms if a voice moves to "
    "it",
    "[dampers]") {
  Preset preset = struck(2);
  const auto played = [&](std::vector<CurvePoint> keys_db, std::vector<Event> events) {
    preset.keys_db = std::move(keys_db);
    Player player(ringing_string(), preset);
    player.run(6000, std::move(events));
    return player.y();
  };
  const std::vector<CurvePoint> scaling = {{48.0, 12.0}, {72.0, -6.0}};
  for (const auto& [key, db] : {std::pair(36, 12.0), std::pair(48, 12.0), std::pair(60, 3.0),
                                std::pair(66, -1.5), std::pair(80, -6.0)}) {
    const std::vector<double> plain = played({}, {note_on(0, key)});
    const std::vector<double> scaled = played(scaling, {note_on(0, key)});
    INFO(key);
    for (std::size_t i = 0; i < plain.size(); ++i) {
      REQUIRE(scaled[i] == Approx(std::pow(10.0, db / 20.0) * plain[i]).margin(1e-15));
    }
  }
  preset.mono = preset.legato = true;
  const std::vector<double> plain = played({}, {note_on(0, 48), note_on(2000, 72)});
  const std::vector<double> scaled = played(scaling, {note_on(0, 48), note_on(2000, 72)});
  const double low = std::pow(10.0, 12.0 / 20.0);
  const double high = std::pow(10.0, -6.0 / 20.0);
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const double way = std::clamp((static_cast<double>(i) - 2000.0) / 882.0, 0.0, 1.0);
    const double loudness = low + way * (high - low);
    // The ramp has 882 steps, and the tolerance is one of them.
    REQUIRE(scaled[i] ==
            Approx(loudness * plain[i]).margin(1e-15 + (low - high) / 882.0 * std::fabs(plain[i])));
  }
}

TEST_CASE("level_db changes the loudness of a note and nothing else", "[dampers]") {
  // The range of 20 dB is divided into equal steps of dB.
  const auto with_level = [](double velocity) {
    Preset preset = struck(1);
    preset.controls[0].low = 0.1;
    preset.controls[0].has_level = true;
    preset.controls[0].low_db = -20.0;
    Player player(ringing_string(), preset);
    player.run(5000, {note_on(0, 60, velocity)});
    return player.y();
  };
  const auto loudest = with_level(1.0);
  const auto middle = with_level(0.5);
  REQUIRE(support::peak(loudest) > 0.01);
  for (std::size_t n = 0; n < loudest.size(); ++n) {
    REQUIRE(std::fabs(middle[n] - loudest[n] * std::pow(10.0, -0.5)) < 1e-12);
  }
}

TEST_CASE("a repeated key damps the earlier voice of that key", "[dampers]") {
  Preset preset = struck(8);
  preset.controls[0].has_level = true;
  Player player(ringing_string(), preset);
  std::vector<Event> events;
  for (std::uint32_t n = 0; n < 10; ++n) {
    events.push_back(note_on(4410 * n, 60));
  }
  player.run(4410 * 10, events);
  CHECK(player.engine().meters().stolen == 0);
  // The T60 is 0.2 s, so four other voices are less than 120 dB down. Half a second later none is.
  CHECK(player.engine().meters().stepped <= 5);
  player.run(22050);
  CHECK(player.engine().meters().stepped == 1);
}

// A hammer rebounds and flies away. If the same voice were struck again, the blows would add up,
// and the hammer would come back at several times its speed.
TEST_CASE("a repeated key strikes with a new hammer", "[dampers]") {
  const std::string hammered =
      scenes::string("s", 10, "0.1", "0.0005") +
      "@h mass 0.5 0. 0.\n@in1 frcInput @h\n@c contact @h @s_m2 0.1 0.001\n" +
      scenes::output(1, "s_m6");
  Player player(hammered, struck(2));
  // A strike replaces the voice before it, whose damper has a T60 of 0.2 s: nothing is left of it
  // after 0.68 s. The second strike and all after it have the same peak, at most that of two
  // voices.
  constexpr std::uint32_t apart = 30000;
  constexpr std::uint32_t strikes = 6;
  std::vector<Event> events;
  for (std::uint32_t n = 0; n < strikes; ++n) {
    events.push_back(note_on(n * apart, 60));
  }
  player.run(strikes * apart, events);
  const auto first = std::span(player.y()).first(apart);
  const auto second = std::span(player.y()).subspan(apart, apart);
  REQUIRE(peak(first) > 1e-3);
  CHECK(peak(second) < 2.0 * peak(first));
  for (std::uint32_t n = 2; n < strikes; ++n) {
    INFO(n);
    CHECK(peak(std::span(player.y()).subspan(n * apart, apart)) ==
          Approx(peak(second)).epsilon(1e-6));
  }
  // The hammers fly on, but each voice ends five seconds after its last sound.
  CHECK(player.engine().meters().stepped > 0);
  player.run(25 * 44100, {note_off(0, 60)});
  CHECK(player.engine().meters().stepped == 0);
}

// Networks are linear, so two strikes sound like the sum of both alone. A voice of a tuned key may
// be inverted, so that it takes nothing from the loud one.
TEST_CASE("a soft strike leaves a louder note ringing, with keys tuned or fixed", "[dampers]") {
  for (const bool is_tuned : {true, false}) {
    INFO(is_tuned);
    Preset preset = struck(4);
    preset.keyboard = is_tuned;
    preset.damper_s = 0.3;
    preset.controls[0].low = preset.controls[0].high;
    preset.controls[0].has_level = true;
    preset.controls[0].low_db = -30.0;
    const auto heard = [&](const std::vector<Event>& events) {
      Player player(ringing_string(), preset);
      player.run(30000, events);
      return player;
    };
    const Event loud = note_on(100, 60, 1.0);
    const Event soft = note_on(10000, 60, 0.2);
    const auto both = heard({loud, soft});
    const auto loud_y = heard({loud}).y();
    const auto soft_y = heard({soft}).y();
    REQUIRE(support::peak(soft_y) > 0.02 * support::peak(loud_y));
    const auto worst = [&](double sign, std::size_t from, std::size_t to) {
      double most = 0.0;
      for (std::size_t n = from; n < to; ++n) {
        most = std::max(most, std::fabs(both.y()[n] - loud_y[n] - sign * soft_y[n]));
      }
      return most / support::peak(loud_y);
    };
    CHECK(worst(1.0, 0, is_tuned ? 10441 : 30000) < 1e-9);  // no decision in the first 10 ms
    CHECK(std::min(worst(1.0, 20000, 30000), worst(-1.0, 20000, 30000)) < 1e-9);
    // Both end with the key, and a second soft strike replaces the first.
    auto three = heard({loud, soft, note_on(12000, 60, 0.2), note_off(25000, 60)});
    three.run(60000);
    CHECK(support::peak(std::span(three.y()).last(1000)) < 1e-3 * support::peak(loud_y));
  }
  // A key that is pressed again lifts its damper, which has lain for 2000 samples of a T60 of
  // 13,230 and so has taken 9.1 dB: 0.35 is left. The soft note is 30 dB below.
  Preset preset = struck(4);
  preset.damper_s = 0.3;
  preset.controls[0].has_level = true;
  preset.controls[0].low_db = -30.0;
  const auto last = [&](const std::vector<Event>& events) {
    Player player(ringing_string(), preset);
    player.run(40000, events);
    return support::peak(std::span(player.y()).last(4000));
  };
  const auto loud = note_on(100, 60, 1.0);
  const auto up = note_off(8000, 60);
  CHECK(last({loud, up, note_on(10000, 60, 0.1)}) > 0.32 * last({loud}));
  CHECK(last({loud, up}) < 0.02 * last({loud}));
}

// Returns a preset whose softest note is as long as its loudest and 12 dB below it.
Preset softer_by_12_db() {
  Preset preset = struck(4);
  preset.controls[0].low = preset.controls[0].high;
  preset.controls[0].has_level = true;
  preset.controls[0].low_db = -12.0;
  return preset;
}

// Returns the sum of squares of a part of the sound.
double power_from(const std::string& text, const Preset& preset, const std::vector<Event>& events,
                  std::size_t from, std::size_t to) {
  Player player(text, preset);
  player.run(to, events);
  return std::accumulate(player.y().begin() + static_cast<std::ptrdiff_t>(from), player.y().end(),
                         0.0, [](double sum, double y) { return sum + y * y; });
}

// A mode of one voice and the same mode of another meet in any phase. A correlation above -0.2 is
// left as it is, so with the ratio r of the amplitudes the power is at least 1 + r^2 - 0.4 r. At
// the best phase the amplitude is the sum of both.
TEST_CASE("a soft strike takes nothing from a louder note of its key", "[dampers]") {
  const std::string text = "@m osc 1. 0.01 0.0001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  const Preset preset = softer_by_12_db();
  const double period = 44100.0 / 261.63;
  double most_db = -100.0;
  for (int eighth = 0; eighth < 8; ++eighth) {
    const auto at = static_cast<std::uint32_t>(4000.0 + period * eighth / 8.0);
    const auto power = [&](const std::vector<Event>& events) {
      return power_from(text, preset, events, at + 1600, 14000);  // after 10 ms and a ramp of 20 ms
    };
    const Event loud = note_on(0, 60, 1.0);
    const Event soft = note_on(at, 60, 0.1);
    const double alone = power({loud});
    const double gain_db = 10.0 * std::log10(power({loud, soft}) / alone);
    const double ratio = std::sqrt(power({soft}) / alone);
    INFO(eighth << ": " << gain_db << " dB");
    CHECK(gain_db > 10.0 * std::log10(1.0 + ratio * ratio - 0.4 * ratio) - 0.1);
    most_db = std::max(most_db, gain_db - 20.0 * std::log10(1.0 + ratio));
  }
  CHECK(most_db == Approx(0.0).margin(0.3));  // amplitudes add up in phase
}

// A soft note 3 Hz above the loud one beats with it. Without a change of its sign it would take
// 20 log10(1 - 0.25) = -2.5 dB in each beat. The decision is at most 10 ms old and a change takes
// 6 ms, in which the phase moves by 0.3: the correlation stays above -0.2 - 0.3, and in a window of
// 50 ms the power above 1 + 0.25^2 - 2 * 0.25 * 0.5 = -0.9 dB. Measured: no window below 0 dB.
TEST_CASE("a soft strike that beats with a louder note of its key takes nothing", "[dampers]") {
  const std::string text = "@m osc 1. 0.01 0.00001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  const Preset preset = softer_by_12_db();
  Event loud = note_on(0, 60, 1.0);
  Event soft = note_on(4000, 60, 0.0001);
  soft.value2 = 264.63;
  constexpr std::size_t window = 2205;
  double least_db = 0.0;
  for (std::size_t from = 5000; from < 40000; from += window) {
    const double alone = power_from(text, preset, {loud}, from, from + window);
    const double both = power_from(text, preset, {loud, soft}, from, from + window);
    least_db = std::min(least_db, 10.0 * std::log10(both / alone));
  }
  CHECK(least_db > -0.9);
}

// A body that resonates at a string's second partial, 1.98 times the first, makes that partial the
// louder one. Its sign decides, though the first is louder in the string. At a correlation of -0.2
// a note 12 dB softer takes 0.16 dB. Measured: 1.0 to 2.8 dB, and -3.9 dB when the string decides.
TEST_CASE("two notes of a key are compared as they are heard behind the body", "[dampers]") {
  const std::string text = ringing_string();
  Preset preset = softer_by_12_db();
  preset.bodies.push_back(
      {"/models/Body.mdl", support::network_of("@r osc 1. 0.00545 0.002 0. 0.\n@in1 frcInput @r\n"
                                               "@out1 posOutput @r\n")});
  const double period = 44100.0 / (1.98 * 261.63);
  for (int eighth = 0; eighth < 8; ++eighth) {
    const auto at = static_cast<std::uint32_t>(4000.0 + period * eighth / 8.0);
    const Event loud = note_on(0, 60, 1.0);
    const Event soft = note_on(at, 60, 0.1);
    const double alone = power_from(text, preset, {loud}, at + 2205, at + 8820);
    const double both = power_from(text, preset, {loud, soft}, at + 2205, at + 8820);
    INFO(eighth);
    CHECK(10.0 * std::log10(both / alone) > -0.25);
  }
}

// A soft blow goes with the motion of what it strikes under fixed tuning, so both energies add up
// and the correlation is not negative. A blow of half a period at any phase. Measured: 1.06 to 1.56
// times the sum of both.
TEST_CASE("a soft blow on a network with fixed tuning adds to its motion", "[dampers]") {
  const std::string text = "@m osc 1. 0.0014 0.00001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  Preset preset = struck(1);
  preset.keyboard = false;
  preset.controls[0].lowest_key = 60;
  preset.controls[0].longest_ms = preset.controls[0].shortest_ms = 1.9;
  const double period = 2.0 * std::numbers::pi / std::sqrt(0.0014);
  for (int eighth = 0; eighth < 8; ++eighth) {
    const auto at = static_cast<std::uint32_t>(6000.0 + period * eighth / 8.0);
    const Event loud = note_on(0, 60, 1.0);
    const Event soft = note_on(at, 60, 0.3);
    const std::size_t from = at + 200;
    const double alone = power_from(text, preset, {loud}, from, from + 9000);
    const double single = power_from(text, preset, {soft}, from, from + 9000);
    const double both = power_from(text, preset, {loud, soft}, from, from + 9000);
    INFO(eighth);
    CHECK(both > 0.98 * (alone + single));
  }
}

// A softer stroke under the pedal leaves the louder one as it is.
TEST_CASE("a bow that a pedal holds goes on when its key is pressed softer", "[dampers]") {
  const std::string text =
      "@in1 posInput 0.\n@m osc 1. 0.01 0.001 0. 0.\n@b nlBow @in1 @m 0.01 0.001\n"
      "@out1 posOutput @in1\n";
  Preset preset;
  preset.voices = 4;
  preset.damper_s = 0.1;
  preset.controls.push_back({.target = "in1", .gesture = Gesture::bow, .low = 0.0, .high = 0.01});
  const std::vector<Event> loud = {controller(0, 64, 1.0), note_on(10, 60, 1.0),
                                   note_off(4000, 60)};
  std::vector<Event> again = loud;
  again.push_back(note_on(6000, 60, 0.2));
  Player alone(text, preset);
  alone.run(12000, loud);
  Player both(text, preset);
  both.run(12000, again);
  REQUIRE(peak(std::span(alone.y()).last(1000)) > 1e-4);
  CHECK(both.y() == alone.y());
  // The stroke ends with the key and the pedal; a harder one replaces it.
  both.run(20000, {note_off(0, 60), controller(0, 64, 0.0)});
  CHECK(peak(std::span(both.y()).last(1000)) == 0.0);
  Player harder(text, preset);
  again.back() = note_on(6000, 60, 1.0);
  harder.run(12000, again);
  CHECK(harder.y() != alone.y());
}

TEST_CASE("a long blow gives as much momentum as a short one", "[dampers]") {
  // A free mass of 1 moves at F / M per sample after the blow, as its position shows.
  const std::string text = "@m mass 1 0 0\n@in1 frcInput @m\n@out1 posOutput @m\n";
  for (const double length_ms : {0.0, 0.5, 4.0}) {
    Preset preset = struck(1);
    preset.keyboard = false;
    preset.controls[0].longest_ms = preset.controls[0].shortest_ms = length_ms;
    Player player(text, preset);
    player.run(1000, {note_on(0, 60)});
    CHECK(player.y()[999] - player.y()[998] == Approx(0.1).epsilon(1e-9));
  }
  // The long blow is duller: a raised cosine of 4 ms leaves less than 1 % of the amplitude at 2
  // kHz.
  const auto at_2khz = [&](double length_ms) {
    Preset preset = struck(1);
    preset.keyboard = false;
    preset.controls[0].longest_ms = preset.controls[0].shortest_ms = length_ms;
    const double k = 2.0 - 2.0 * std::cos(2.0 * std::numbers::pi * 2000.0 / 44100.0);
    Player player("@g ground 0\n@m mass 1 0 0\n@s springDamper @m @g " + std::to_string(k) +
                      " 0\n@in1 frcInput @m\n@out1 posOutput @m\n",
                  preset);
    player.run(2000, {note_on(0, 60)});
    return support::peak(std::span<const double>(player.y()).subspan(1000));
  };
  CHECK(at_2khz(4.0) < 0.01 * at_2khz(0.0));
  CHECK(at_2khz(0.25) > 0.8 * at_2khz(0.0));
}

TEST_CASE("a touch finger rests off the string and is laid on by a controller", "[dampers]") {
  Preset preset;
  preset.keyboard = false;
  preset.controls.push_back({.source = ControlSource::controller,
                             .number = 16,
                             .target = "in1",
                             .gesture = Gesture::touch,
                             .low = -3.0,
                             .high = 1.0});
  Player player(
      "@m mass 1 0 0\n@in1 posInput 0\n@s springDamper @m @in1 0.1 0\n"
      "@out1 posOutput @in1\n",
      preset);
  player.run(20000, {controller(100, 16, 0.5)});
  CHECK(player.y()[0] == -3.0);
  // A touch wakes no sleeping voice.
  Player silent(
      "@m mass 1 0 0\n@in1 posInput 0\n@t contact @in1 @m 0.1 0 0\n"
      "@s springDamper @m @g 0.1 0.01\n@g ground 0\n@out1 posOutput @m\n",
      preset);
  silent.run(100000);
  CHECK(silent.engine().meters().stepped == 0);
  silent.run(5000, {controller(100, 16, 0.5)});
  CHECK(silent.engine().meters().stepped == 0);
  CHECK(player.y()[19999] == Approx(-1.0).epsilon(1e-8));
}

TEST_CASE("DC is blocked below 5 Hz, and nothing above 60 Hz changes", "[dampers]") {
  constexpr double rate_hz = 48000.0;
  const auto response = [&](double hz) {
    DcBlocker blocker(rate_hz);
    std::vector<double> y(static_cast<std::size_t>(4 * rate_hz));
    for (std::size_t n = 0; n < y.size(); ++n) {
      y[n] = std::cos(2.0 * std::numbers::pi * hz * static_cast<double>(n) / rate_hz);
    }
    double* const channel = y.data();
    blocker.process({&channel, 1}, y.size());
    return support::peak(std::span<const double>(y).subspan(y.size() / 2));
  };
  CHECK(response(0.0) < 1e-12);
  CHECK(response(5.0) == Approx(std::numbers::sqrt2 / 2.0).epsilon(1e-3));
  CHECK(20.0 * std::log10(response(60.0)) > -0.05);
  // A step decays by 60 dB within a second.
  DcBlocker blocker(rate_hz);
  std::vector<double> step(48001, 1.0);
  double* const channel = step.data();
  blocker.process({&channel, 1}, step.size());
  CHECK(std::fabs(step.back()) < 1e-3);
  // When the sound ends the filter's state decays too: it falls to 1e-7 in 16 time constants of 0.5
  // ms.
  std::vector<double> nothing(480, 0.0);
  double* const after = nothing.data();
  blocker.process({&after, 1}, nothing.size());
  CHECK(std::fabs(nothing.front()) > 0.9);
  CHECK(nothing.back() == 0.0);
}

TEST_CASE("sound without DC passes the DC blocker, and a filtered sound follows without a step",
          "[dampers]") {
  DcBlocker blocker(48000.0);
  std::vector<double> sound(64);
  for (std::size_t n = 0; n < sound.size(); ++n) {
    sound[n] = std::cos(0.1 * static_cast<double>(n));
  }
  const std::vector<double> before = sound;
  double* const channel = sound.data();
  blocker.process({&channel, 1}, sound.size(), false);
  CHECK(sound == before);
  // A constant that follows decays from its own level, by 1 - 2 pi 5 Hz / 48 kHz a sample.
  std::vector<double> constant(480, before.back());
  double* const after = constant.data();
  blocker.process({&after, 1}, constant.size(), true);
  CHECK(constant[0] == Approx(before.back()).epsilon(1e-3));
  CHECK(constant[479] == Approx(before.back() * std::exp(-2.0 * std::numbers::pi * 5.0 * 0.01)));
  // The filter goes on until it holds nothing, and passes again after silence.
  std::vector<double> rest = before;
  double* const third = rest.data();
  blocker.process({&third, 1}, rest.size(), false);
  CHECK(rest != before);
  std::vector<double> silence(4800, 0.0);
  double* const fourth = silence.data();
  blocker.process({&fourth, 1}, silence.size(), false);
  std::vector<double> again = before;
  double* const fifth = again.data();
  blocker.process({&fifth, 1}, again.size(), false);
  CHECK(again == before);
}

TEST_CASE("the DC blocker filters each channel as it would alone", "[dampers]") {
  // Two channels are filtered together until one of them is silent. The bits must not depend on
  // that, nor on the block size.
  constexpr std::size_t frames = 4096;
  std::vector<std::vector<double>> sound(3, std::vector<double>(frames));
  for (std::size_t c = 0; c < sound.size(); ++c) {
    for (std::size_t n = 100 * c; n < frames; ++n) {
      const bool is_silent = n / (300 + 70 * c) % 3 == 1;
      sound[c][n] = is_silent ? 0.0 : std::sin(0.01 * static_cast<double>(n * (c + 1))) + 0.5;
    }
  }
  std::vector<std::vector<double>> alone = sound;
  for (std::vector<double>& channel : alone) {
    DcBlocker blocker(48000.0);
    double* const all = channel.data();
    blocker.process({&all, 1}, frames);
  }
  DcBlocker blocker(48000.0);
  for (std::size_t at = 0, block = 1; at < frames; at += block, block = block % 97 + 1) {
    std::vector<double*> channels;
    for (std::vector<double>& channel : sound) {
      channels.push_back(channel.data() + at);
    }
    blocker.process(channels, std::min(block, frames - at));
  }
  CHECK(sound == alone);
}

// Two channels of 331 samples, one silent in the middle, are filtered in blocks of 1 to 70 samples.
TEST_CASE("the DC blocker gives the same bits with every instruction set", "[dampers]") {
  DcPoles poles{.power = {1.0, 0.999, 0.998, 0.997, 0.996}, .quick = 0.95};
  const auto filtered = [&](Isa isa) {
    const FilterDc filter = with_isa(isa, []<Isa level>() { return dc_filter<level>(); });
    std::vector<double> sound(2 * 331);
    for (std::size_t n = 0; n < sound.size(); ++n) {
      sound[n] = n > 100 && n < 200 ? 0.0 : 0.5 + std::sin(0.1 * static_cast<double>(n));
    }
    DcState states[2];
    for (std::size_t at = 0, block = 1; at < 331; at += block, block = block % 70 + 1) {
      const std::array<double*, 2> channels{sound.data() + at, sound.data() + 331 + at};
      filter(channels, std::min<std::size_t>(block, 331 - at), poles, states);
    }
    return sound;
  };
  const std::vector<double> expected = filtered(Isa::base);
  CHECK(support::peak(expected) > 0.5);
  for (const Isa isa : {Isa::v3, Isa::v4}) {
    if (has_isa(isa)) {
      CHECK(filtered(isa) == expected);
    }
  }
}

}  // namespace
}  // namespace ressort::dampers_test
