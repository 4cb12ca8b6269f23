// Values that differ from key to key and with velocity: parameters, gestures and dampers.
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/compile/instrument.h"
#include "tests/support/catch.h"
#include "tests/support/partial.h"
#include "tests/support/player.h"

namespace ressort::curves_test {
namespace {

using support::cents;
using support::network_of;
using support::note_off;
using support::note_on;
using support::parameter;
using support::partial_of;
using support::peak;
using support::Player;
using support::struck;

// Two partials of a stiff string, f n sqrt(1 + B n^2), that ring for 20 s.
const std::string stiff_string =
    "@B param 0.001\n"
    "@s body 1. all\n"
    "@m1 mode @s 261.63*sqrt(1+B) 20. 1.\n"
    "@m2 mode @s 261.63*2*sqrt(1+4*B) 20. 1.\n"
    "@in1 frcInput [@s all]\n"
    "@out1 posOutput [@s all]\n";

Preset with_curve(int voices = 1) {
  Preset preset = struck(voices);
  preset.parameters = {{"B", 1e-3, 1e-5, 0.1}};
  preset.parameters[0].keys = {{36, 1e-4}, {84, 1e-2}};
  return preset;
}

double key_hz(int key) {
  return 440.0 * std::exp2((key - 69) / 12.0);
}

// The interval of both partials, for which the string's B is the only cause.
double interval(const std::vector<double>& y, double hz, double b) {
  const auto heard = [&](double guess) {
    return partial_of(y, 44100.0, guess, 0.05, 1.0, 0.01).hz;
  };
  return heard(hz * 2.0 * std::sqrt((1.0 + 4.0 * b) / (1.0 + b))) / heard(hz);
}

TEST_CASE("a curve is joined by equal ratios, and a knob moves it as a ratio", "[curves]") {
  const VoiceCurve curve{.keys = {{36, 1e-4}, {84, 1e-2}},
                         .velocity = {{0, 0.5}, {127, 2.0}},
                         .keys_at = 1e-3,
                         .lowest = 1e-5,
                         .highest = 0.1};
  CHECK(curve.on_key(60, 1e-3) == Approx(1e-3).epsilon(1e-12));
  CHECK(curve.on_key(0, 1e-3) == Approx(1e-4).epsilon(1e-12));
  CHECK(curve.on_key(60, 3e-3) == Approx(3e-3).epsilon(1e-12));
  CHECK(curve.at(60, 127, 3e-3) == Approx(6e-3).epsilon(1e-12));
  CHECK(curve.at(84, 127, 1e-2) == 0.1);  // the range's end
  const VoiceCurve both_sides{
      .keys = {{36, -1}, {84, 1}}, .velocity = {}, .keys_at = 0.5, .lowest = -2, .highest = 2};
  CHECK(both_sides.on_key(48, 0.5) == Approx(-0.5).epsilon(1e-12));
  CHECK(both_sides.on_key(48, 0.7) == Approx(-0.3).epsilon(1e-12));
}

TEST_CASE("keys are in tune with their own parameters, and have their own partials", "[curves]") {
  for (const Precision precision : {Precision::float64, Precision::float32}) {
    for (const int key : {36, 45, 60, 76, 84}) {
      Player player(stiff_string, with_curve(), {.precision = precision});
      player.run(2 * 44100, {note_on(0, key)});
      const double b = 1e-4 * std::pow(100.0, (key - 36) / 48.0);
      const double hz = partial_of(player.y(), 44100.0, key_hz(key), 0.05, 1.0, 0.5).hz;
      CHECK(std::fabs(cents(hz, key_hz(key))) < 0.05);
      CHECK(std::fabs(cents(interval(player.y(), key_hz(key), b),
                            2.0 * std::sqrt((1.0 + 4.0 * b) / (1.0 + b)))) < 0.1);
      CHECK(player.heap_calls == 0);
    }
  }
}

TEST_CASE("two keys held at once have the values of each alone", "[curves]") {
  for (const Method method : {Method::direct, Method::batch, Method::modal}) {
    const auto played = [&](const std::vector<Event>& events) {
      Player player(stiff_string, with_curve(2), {.method = method});
      player.run(8000, events);
      return player.y();
    };
    const auto both = played({note_on(0, 40), note_on(0, 80)});
    const auto low = played({note_on(0, 40)});
    const auto high = played({note_on(0, 80)});
    double off = 0.0;
    for (std::size_t n = 0; n < both.size(); ++n) {
      off = std::max(off, std::fabs(both[n] - low[n] - high[n]));
    }
    CHECK(off < 1e-9 * peak(both));
  }
}

TEST_CASE("a turned knob moves the voices that sound", "[curves]") {
  Player player(stiff_string, with_curve(2));
  player.run(1000, {note_on(0, 36), note_on(0, 84), parameter(500, 0, 3e-3)});
  player.run(2 * 44100);
  const std::vector<double> y(player.y().begin() + 4000, player.y().end());
  for (const auto& [key, b] : {std::pair(36, 3e-4), std::pair(84, 3e-2)}) {
    const double before = b / 3.0;
    // The stiffness factor is that of the curve's own value.
    const double first = key_hz(key) * std::sqrt((1.0 + b) / (1.0 + before));
    CHECK(std::fabs(cents(partial_of(y, 44100.0, first, 0.05, 1.0, 0.1).hz, first)) < 0.05);
    const double second = 2.0 * key_hz(key) * std::sqrt((1.0 + 4.0 * b) / (1.0 + before));
    CHECK(std::fabs(cents(partial_of(y, 44100.0, second, 0.05, 1.0, 0.1).hz, second)) < 0.1);
  }
}

TEST_CASE("a bend keeps the values of its key", "[curves]") {
  Player player(stiff_string, with_curve());
  Event bend{.kind = EventKind::bend, .value = 1.0};  // two semitones up
  player.run(2 * 44100, {bend, note_on(0, 84)});
  CHECK(std::fabs(cents(interval(player.y(), key_hz(86), 1e-2),
                        2.0 * std::sqrt((1.0 + 0.04) / (1.0 + 0.01)))) < 0.1);
  CHECK(std::fabs(cents(partial_of(player.y(), 44100.0, key_hz(86), 0.05, 1.0, 0.5).hz,
                        key_hz(86))) < 0.05);
}

TEST_CASE("a voice that slept has the values of its next key and of a knob turned meanwhile",
          "[curves]") {
  Preset preset = with_curve();
  preset.damper_s = 0.01;
  const auto played_after = [&](const std::vector<Event>& before) {
    Player player(stiff_string, preset);
    player.run(4410, before);
    player.run(22050, {note_off(0, 40)});
    player.run(100, {parameter(0, 0, 3e-3)});
    player.run(2 * 44100, {note_on(0, 84)});
    return std::vector<double>(player.y().end() - 2 * 44100, player.y().end());
  };
  const auto fresh = played_after({});
  const auto later = played_after({note_on(0, 40)});
  double off = 0.0;
  for (std::size_t n = 0; n < fresh.size(); ++n) {
    off = std::max(off, std::fabs(later[n] - fresh[n]));
  }
  CHECK(off < 1e-12 * peak(fresh));
  const double first = key_hz(84) * std::sqrt((1.0 + 3e-2) / (1.0 + 1e-2));
  CHECK(std::fabs(cents(interval(fresh, first, 3e-2),
                        2.0 * std::sqrt((1.0 + 0.12) / (1.0 + 0.03)))) < 0.1);
}

TEST_CASE("a strike's velocity changes its own voice, and a re-strike changes it again",
          "[curves]") {
  Preset preset = with_curve();
  preset.parameters[0].keys.clear();
  preset.parameters[0].velocity = {{0, 1.0}, {127, 4.0}};
  const auto b_of = [](const std::vector<double>& y) {
    const double ratio = interval(y, key_hz(60), 2e-3) / 2.0;  // sqrt((1 + 4b)/(1 + b))
    return (ratio * ratio - 1.0) / (4.0 - ratio * ratio);
  };
  Player player(stiff_string, preset);
  player.run(2 * 44100, {note_on(0, 60, 1.0 / 3.0)});
  CHECK(b_of(player.y()) == Approx(2e-3).epsilon(0.02));
  player.run(2 * 44100, {note_on(0, 60, 1.0)});
  CHECK(b_of({player.y().end() - 80000, player.y().end()}) == Approx(4e-3).epsilon(0.02));
}

// A mass that a force pushes without any spring of note: its velocity shows the pulse.
const std::string free_mass = "@m osc 1. 1.357e-6 0. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";

// Returns the time in which the velocity of the mass goes from 10 to 90 % of its final value.
double rise_ms(const Preset& preset, int key) {
  Player player(free_mass, preset);
  player.run(2000, {note_on(0, key)});
  const auto speed = [&](std::size_t n) { return player.y()[n + 1] - player.y()[n]; };
  double most = 0.0;
  for (std::size_t n = 0; n < 500; ++n) {
    most = std::max(most, speed(n));
  }
  std::size_t first = 0;
  while (speed(first) < 0.1 * most) {
    ++first;
  }
  std::size_t last = first;
  while (speed(last) < 0.9 * most) {
    ++last;
  }
  return static_cast<double>(last - first) / 44.1;
}

TEST_CASE("contact times follow the pitch, or not, or a curve", "[curves]") {
  // Keys whose period is long beside the pulse: key 0, the written pitch, has 8.2 Hz.
  Preset preset = struck(1);
  preset.controls[0].longest_ms = preset.controls[0].shortest_ms = 4.0;
  const double written = rise_ms(preset, 0);
  // The velocity of a raised cosine's sum rises from 10 to 90 % within 0.48 of its duration.
  CHECK(written == Approx(0.48 * 4.0).epsilon(0.05));
  CHECK(rise_ms(preset, 12) == Approx(0.5 * written).epsilon(0.05));
  preset.controls[0].follows_pitch = false;
  CHECK(rise_ms(preset, 0) == Approx(rise_ms(preset, 12)).epsilon(0.05));
  preset.controls[0].length_keys = {{0, 4.0, 4.0}, {12, 2.0, 2.0}};
  CHECK(rise_ms(preset, 0) == Approx(written).epsilon(0.05));
  CHECK(rise_ms(preset, 12) == Approx(0.5 * written).epsilon(0.05));
  CHECK(rise_ms(preset, 6) == Approx(0.75 * written).epsilon(0.05));
}

// A string of mass 1 with 24 partials n sqrt(1 + B n^2) (as modes of mass 1/2) and a felt
// F = k d^2.5 on a hammer of mass 0.75, in samples of 44.1 kHz.
constexpr double hammer_mass = 0.75;
constexpr double struck_at = 0.12;
constexpr double stiffness = 1e-4;
constexpr double felt_power = 2.5;
constexpr int partials = 24;

// The hammer's height and speed, then those of each mode.
using Motion = std::array<double, 2 + 2 * partials>;

double felt_depth(const Motion& now) {
  double depth = now[0];
  for (int n = 1; n <= partials; ++n) {
    depth -= now[static_cast<std::size_t>(2 * n)] * std::sin(n * std::numbers::pi * struck_at);
  }
  return depth;
}

// Returns the derivatives in Newton's equations of the hammer and of every mode.
Motion derivative(const Motion& now, double hz, double k) {
  const double force = k * std::pow(std::max(0.0, felt_depth(now)), felt_power);
  Motion change{};
  change[0] = now[1];
  change[1] = -force / hammer_mass;
  for (int n = 1; n <= partials; ++n) {
    const auto at = static_cast<std::size_t>(2 * n);
    const double stretch = std::sqrt((1.0 + stiffness * n * n) / (1.0 + stiffness));
    const double turn = 2.0 * std::numbers::pi * hz * n * stretch / 44100.0;
    change[at] = now[at + 1];
    change[at + 1] =
        -turn * turn * now[at] + 2.0 * force * std::sin(n * std::numbers::pi * struck_at);
  }
  return change;
}

// Returns the time from the first to the last touch, in ms. `depth_after` returns the depth of the
// felt, above 0 in contact, `step` samples later.
template <class Depth>
double contact_ms(double step, Depth&& depth_after) {
  constexpr double watched = 500.0;  // samples; the slowest hammer leaves after 330
  std::optional<double> first;
  double last = 0.0;
  double before = 0.0;
  for (double at = step; at < watched; at += step) {
    const double depth = depth_after();
    if ((before > 0.0) != (depth > 0.0)) {
      const double crossing = at - step * depth / (depth - before);
      first = first.value_or(crossing);
      last = crossing;
    }
    before = depth;
  }
  return (last - first.value_or(0.0)) / 44.1;
}

// The same by Runge and Kutta's method in steps of 1/16 sample, whose error is far below 1e-4.
double solved_contact_ms(double hz, double k, double speed) {
  constexpr double step = 1.0 / 16.0;
  Motion now{};
  now[1] = speed;
  return contact_ms(step, [&] {
    const auto moved = [&](const Motion& by, double share) {
      Motion sum = now;
      for (std::size_t i = 0; i < sum.size(); ++i) {
        sum[i] += share * step * by[i];
      }
      return sum;
    };
    const Motion a = derivative(now, hz, k);
    const Motion b = derivative(moved(a, 0.5), hz, k);
    const Motion c = derivative(moved(b, 0.5), hz, k);
    const Motion d = derivative(moved(c, 1.0), hz, k);
    for (std::size_t i = 0; i < now.size(); ++i) {
      now[i] += step / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
    }
    return felt_depth(now);
  });
}

TEST_CASE("a hammer touches a string as long as its equation of motion says, by key and velocity",
          "[curves]") {
  const std::string text =
      "@k param 0.03\n@s modalString 24 1. 261.63 0.0001 0.01 0 0\n@h mass 0.75 0. 0.\n"
      "@in1 frcInput @h\n@felt powerContact @h [@s 0.12] k 2.5\n"
      "@out1 posOutput @h\n@out2 posOutput [@s 0.12]\n";
  Preset preset = struck(1);
  preset.controls[0].low = 0.003;
  preset.controls[0].high = 0.03;
  preset.controls[0].follows_pitch = false;
  preset.fixed = {"h", "felt"};
  preset.parameters = {{"k", 0.03, 1e-4, 10.0}};
  preset.parameters[0].keys = {{36, 0.003}, {60, 0.03}, {84, 1.0}};
  double longest_ms = 0.0;
  double shortest_ms = 1e9;
  for (const int key : {36, 60, 84}) {
    double soft_ms = 0.0;
    for (const double velocity : {0.1, 1.0}) {
      const double force = 0.003 + 0.027 * velocity;
      const double k = key == 36 ? 0.003 : key == 60 ? 0.03 : 1.0;
      const double expected = solved_contact_ms(key_hz(key), k, force / hammer_mass);
      for (const double rate_hz : {44100.0, 96000.0}) {
        Player player(text, preset, {.rate_hz = rate_hz});
        player.run(static_cast<std::size_t>(0.02 * rate_hz), {note_on(0, key, velocity)});
        std::size_t frame = 0;
        const double found = contact_ms(44100.0 / rate_hz, [&] {
          const double depth = player.out[0][frame] - player.out[1][frame];
          ++frame;
          return depth;
        });
        INFO("key " << key << ", velocity " << velocity << ", " << rate_hz << " Hz");
        CHECK(found == Approx(expected).epsilon(0.006));
        CHECK(player.heap_calls == 0);
      }
      longest_ms = std::max(longest_ms, expected);
      shortest_ms = std::min(shortest_ms, expected);
      CHECK((velocity == 0.1 || expected < soft_ms));  // a hard blow is shorter
      soft_ms = expected;
    }
  }
  CHECK(longest_ms > 5.0 * shortest_ms);
}

TEST_CASE("levels and ranges by key scale the sound", "[curves]") {
  const auto peak_of = [](const Preset& preset, int key) {
    Player player(stiff_string, preset);
    player.run(4000, {note_on(0, key)});
    return peak(player.y());
  };
  Preset preset = struck(1);
  const double low = peak_of(preset, 48);
  const double high = peak_of(preset, 72);
  preset.controls[0].range_keys = {{48, 0.0, 0.05}, {72, 0.0, 0.3}};
  CHECK(peak_of(preset, 48) == Approx(0.5 * low).epsilon(1e-6));
  CHECK(peak_of(preset, 72) == Approx(3.0 * high).epsilon(1e-6));
}

TEST_CASE("a damper by key is absent where its time is 0", "[curves]") {
  Preset preset = struck(1);
  preset.damper_keys = {{21, 0.1}, {88, 0.1}, {89, 0.0}};
  const auto left = [&](int key) {
    Player player(stiff_string, preset);
    player.run(22050, {note_on(0, key), note_off(4410, key)});
    return peak(std::span(player.y()).last(4410)) / peak(std::span(player.y()).first(4410));
  };
  CHECK(left(88) < 0.01);
  CHECK(left(89) > 0.5);
}

TEST_CASE("curves do not fit audio parameters and levels of outputs", "[curves]") {
  const auto error_of = [](const std::string& model) {
    Preset preset = with_curve();
    preset.parameters[0].location = {7, 5};
    const auto made = compile_network(network_of(model), preset, {});
    REQUIRE_FALSE(made);
    CHECK(made.error().line == 7);
    CHECK(made.error().column == 5);
    return made.error().message;
  };
  CHECK(error_of("@B param 0.001\n@m osc 1. 0.01 0. 0. 0.\n@in1 frcInput @m\n"
                 "@out1 posOutput @m B\n")
            .starts_with("'B' sets the level of an output"));
  CHECK(error_of("@B audioParam @in2\n@m osc 1. B 0. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n")
            .starts_with("'B' is set by an audio input"));
}

}  // namespace
}  // namespace ressort::curves_test
