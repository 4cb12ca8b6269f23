// LFOs and small differences from note to note, measured on the engine's output.
#include "tests/support/player.h"

namespace ressort::lfo_test {
namespace {

using namespace support;

// One mode, which loses 0.4 dB per second.
const std::string tone =
    "@g ground 0.\n@m mass 1. 0. 0.\n@k springDamper @g @m 0.004 0.000002\n@in1 frcInput @m\n"
    "@out1 posOutput @m\n";

Preset moved(const LfoSetting& lfo, const std::string& target, double low, double high) {
  Preset preset = struck(4);
  preset.lfos = {lfo};
  preset.controls.push_back({.source = ControlSource::lfo,
                             .address = lfo.name,
                             .target = target,
                             .gesture = Gesture::parameter,
                             .low = low,
                             .high = high});
  return preset;
}

struct Reading {
  double time_s;
  double value;
};

// Cents above 440 Hz in each period, from the zero crossings.
std::vector<Reading> cents_of(std::span<const double> y) {
  std::vector<Reading> cents;
  double before = 0.0;
  for (std::size_t n = 1; n < y.size(); ++n) {
    if (y[n - 1] < 0.0 && y[n] >= 0.0) {
      const double at = static_cast<double>(n) - y[n] / (y[n] - y[n - 1]);
      if (before > 0.0) {
        cents.push_back(
            {0.5 * (at + before) / 44100.0, 1200.0 * std::log2(44100.0 / (at - before) / 440.0)});
      }
      before = at;
    }
  }
  return cents;
}

double greatest(const std::vector<Reading>& readings, double from_s, double to_s) {
  double most = -1e9;
  for (const Reading& reading : readings) {
    if (reading.time_s >= from_s && reading.time_s < to_s) {
      most = std::max(most, reading.value);
    }
  }
  return most;
}

// Returns the reading nearest to a time.
double at(const std::vector<Reading>& readings, double time_s) {
  return std::ranges::min_element(readings, {},
                                  [&](const Reading& r) { return std::fabs(r.time_s - time_s); })
      ->value;
}

// Rate of the upward zero crossings after `from_s`.
double rate_of(const std::vector<Reading>& readings, double from_s) {
  std::vector<double> crossings;
  for (std::size_t i = 1; i < readings.size(); ++i) {
    const Reading& a = readings[i - 1];
    const Reading& b = readings[i];
    if (a.time_s > from_s && a.value < 0.0 && b.value >= 0.0) {
      crossings.push_back(b.time_s - (b.time_s - a.time_s) * b.value / (b.value - a.value));
    }
  }
  REQUIRE(crossings.size() > 2);
  return static_cast<double>(crossings.size() - 1) / (crossings.back() - crossings.front());
}

// Peaks of windows of 10 ms in dB.
std::vector<Reading> levels_of(std::span<const double> y) {
  std::vector<Reading> levels;
  for (std::size_t at = 0; at + 441 <= y.size(); at += 441) {
    levels.push_back({static_cast<double>(at + 220) / 44100.0,
                      20.0 * std::log10(std::max(1e-30, peak(y.subspan(at, 441))))});
  }
  return levels;
}

std::vector<double> heard(const Preset& preset, const std::vector<Event>& events,
                          std::size_t frames = 4 * 44100, const std::string& model = tone) {
  Player player(model, preset);
  player.run(frames, events);
  CHECK(player.heap_calls == 0);
  return player.y();
}

const std::vector<Event> one_note = {note_on(0, 69)};

}  // namespace

TEST_CASE("a vibrato has its rate and depth, after its delay and fade", "[lfo]") {
  for (const LfoShape shape : {LfoShape::sine, LfoShape::triangle}) {
    const LfoSetting vibrato{
        .name = "v", .lfo = {.rate_hz = 5.0, .delay_s = 0.5, .fade_s = 1.0, .shape = shape}};
    const auto cents = cents_of(heard(moved(vibrato, "pitch", -50.0, 50.0), one_note));
    CHECK(std::fabs(greatest(cents, 0.0, 0.45)) < 0.5);
    CHECK(greatest(cents, 0.9, 1.1) == Approx(25.0).epsilon(0.15));  // the 3rd crest, at 0.95 s
    CHECK(greatest(cents, 2.0, 4.0) == Approx(50.0).epsilon(0.05));
    CHECK(rate_of(cents, 1.5) == Approx(5.0).epsilon(0.01));
  }
}

// The pitch of a struck drum: 80 cents sharp at first, 80/e after 0.1 s. A note that is 6 dB below
// the loudest has a quarter of its energy, so it starts 20 cents sharp.
TEST_CASE("a fall starts at its depth, which may follow the energy of the note", "[lfo]") {
  LfoSetting tension{.name = "t", .lfo = {.rate_hz = 10.0, .shape = LfoShape::fall}};
  tension.by = ControlSource::note;
  for (const double level_db : {0.0, -6.0206}) {
    Preset preset = moved(tension, "pitch", -80.0, 80.0);
    for (ControlSetting& control : preset.controls) {
      if (control.source == ControlSource::note) {
        control.has_level = true;
        control.low_db = control.high_db = level_db;
      }
    }
    const auto cents = cents_of(heard(preset, one_note));
    const double start = 80.0 * std::pow(10.0, level_db / 10.0);
    CHECK(at(cents, 0.1) == Approx(start / std::numbers::e).epsilon(0.04));
    CHECK(at(cents, 0.2) == Approx(start * std::exp(-2.0)).epsilon(0.04));
    CHECK(std::fabs(at(cents, 1.0)) < 0.5);
  }
}

TEST_CASE("a mono note to which a channel returns is as a new one", "[lfo]") {
  Preset preset =
      moved({.name = "t", .lfo = {.rate_hz = 10.0, .shape = LfoShape::fall}}, "pitch", -80.0, 80.0);
  preset.mono = true;
  const auto after = [&](const Event& last) {
    auto y = heard(preset, {note_on(0, 69), note_on(4096, 72), last});
    return std::vector<double>(y.begin() + 8192, y.begin() + 44100);
  };
  const auto returned = after(note_off(8192, 72));
  CHECK(returned == after(note_on(8192, 69)));
}

// Two oscillations per beat are 4 Hz at 120 beats per minute and 6 Hz at 180. The oscillation is at
// the middle of its turn when the tempo changes, so a jump of the phase would move the pitch by
// many times the largest step of a vibrato of 6 Hz: 2 pi 6 Hz * 50 cents / 440 Hz.
TEST_CASE("an LFO in beats follows the tempo without a jump", "[lfo]") {
  const LfoSetting vibrato{.name = "v", .lfo = {.beats = 0.5}};
  const std::uint32_t change = 49613;  // 1.125 s: 4.5 turns
  const Event tempo{.frame = change, .kind = EventKind::tempo, .value = 3.0};
  const auto cents = cents_of(heard(moved(vibrato, "pitch", -50.0, 50.0), {note_on(0, 69), tempo}));
  std::vector<Reading> before = cents;
  std::erase_if(before, [](const Reading& reading) { return reading.time_s > 1.1; });
  CHECK(rate_of(before, 0.05) == Approx(4.0).epsilon(0.01));
  CHECK(rate_of(cents, 1.2) == Approx(6.0).epsilon(0.01));
  const double steepest = 2.0 * std::numbers::pi * 6.0 * 50.0 / 440.0;
  for (std::size_t i = 20; i < cents.size(); ++i) {
    CHECK(std::fabs(cents[i].value - cents[i - 1].value) < 1.5 * steepest);
  }
}

TEST_CASE("a tremolo changes the level by its range in dB", "[lfo]") {
  const LfoSetting tremolo{.name = "t", .lfo = {.rate_hz = 4.0, .delay_s = 0.5}};
  const auto there = levels_of(heard(moved(tremolo, "level", -12.0, 0.0), one_note));
  const auto plain = levels_of(heard(struck(4), one_note));
  std::vector<Reading> change;
  for (std::size_t i = 0; i < there.size(); ++i) {
    change.push_back({there[i].time_s, there[i].value - plain[i].value});
  }
  CHECK(greatest(change, 0.02, 0.45) == Approx(-6.0).margin(0.1));  // the middle
  CHECK(greatest(change, 1.0, 4.0) == Approx(0.0).margin(0.3));
  for (Reading& reading : change) {
    reading.value = -reading.value;
  }
  CHECK(greatest(change, 1.0, 4.0) == Approx(12.0).margin(0.6));
  for (Reading& reading : change) {
    reading.value -= 6.0;
  }
  CHECK(rate_of(change, 0.6) == Approx(4.0).epsilon(0.01));
}

TEST_CASE("the wheel scales the depth of a vibrato, and each note has a vibrato of its own",
          "[lfo]") {
  LfoSetting vibrato{.name = "v", .lfo = {.rate_hz = 5.0}};
  vibrato.by = ControlSource::controller;
  vibrato.number = 1;
  const Preset preset = moved(vibrato, "pitch", -50.0, 50.0);
  CHECK(heard(preset, one_note) == heard(struck(4), one_note));
  const auto cents = cents_of(heard(preset, {controller(0, 1, 0.5), note_on(0, 69)}));
  CHECK(greatest(cents, 1.0, 4.0) == Approx(25.0).epsilon(0.05));
  // A voice that starts later starts its LFO later.
  const std::vector<double> late =
      heard(preset, {controller(0, 1, 1.0), note_on(0, 69), note_on(64 * 90, 69 + 12)}, 44100);
  const std::vector<double> low = heard(preset, {controller(0, 1, 1.0), note_on(0, 69)}, 44100);
  const std::vector<double> high =
      heard(preset, {controller(0, 1, 1.0), note_on(0, 69 + 12)}, 44100);
  double most = 0.0;
  for (std::size_t n = 0; n < late.size(); ++n) {
    const double expected = low[n] + (n < 64 * 90 ? 0.0 : high[n - 64 * 90]);
    most = std::max(most, std::fabs(late[n] - expected));
  }
  CHECK(most < 1e-9 * peak(low));
}

// The same mode with its stiffness as a parameter, whose square root is the pitch.
const std::string stiff =
    "@K param 0.004\n@g ground 0.\n@m mass 1. 0. 0.\n@k springDamper @g @m K 0.000002\n"
    "@in1 frcInput @m\n@out1 posOutput @m\n";

TEST_CASE("an LFO moves a parameter in each voice by a factor within its range", "[lfo]") {
  const LfoSetting lfo{.name = "v", .lfo = {.rate_hz = 5.0, .delay_s = 0.5}};
  Preset preset = moved(lfo, "K", 0.9, 1.1);
  preset.parameters.push_back({.name = "K", .value = 0.004, .minimum = 0.001, .maximum = 0.008});
  auto cents = cents_of(heard(preset, one_note, 4 * 44100, stiff));
  CHECK(std::fabs(greatest(cents, 0.0, 0.45)) < 0.5);
  CHECK(greatest(cents, 0.6, 4.0) == Approx(600.0 * std::log2(1.1)).epsilon(0.05));
  CHECK(rate_of(cents, 0.6) == Approx(5.0).epsilon(0.01));
  for (Reading& reading : cents) {
    reading.value = -reading.value;
  }
  CHECK(greatest(cents, 0.6, 4.0) == Approx(-600.0 * std::log2(0.9)).epsilon(0.05));
  // The value stays within the parameter's range.
  preset.parameters[0].maximum = 0.0042;
  cents = cents_of(heard(preset, one_note, 4 * 44100, stiff));
  CHECK(greatest(cents, 0.6, 4.0) == Approx(600.0 * std::log2(1.05)).epsilon(0.05));
}

// A mass of 1 decays by Z / 2 nepers a sample. While Z moves from Z0 to Z1 in N samples, the level
// falls by (Z1 - Z0) N / 4 nepers less than with a jump. A ramp of 128 samples, that of a vibrato,
// would leave 3.1 dB less than one of 882. The steps of 64 samples may lag by 128: 1.1 dB.
TEST_CASE("a knob is ramped over 20 ms under a vibrato as without one", "[lfo]") {
  const std::string model =
      "@Z param 0.0001\n@g ground 0.\n@m mass 1. 0. 0.\n@k springDamper @g @m 0.004 Z\n"
      "@in1 frcInput @m\n@out1 posOutput @m\n";
  Preset still = struck(4);
  still.parameters.push_back({.name = "Z", .value = 0.0001, .minimum = 0.0001, .maximum = 0.002});
  const LfoSetting lfo{.name = "v", .lfo = {.rate_hz = 5.0}};
  Preset swung = moved(lfo, "pitch", -20.0, 20.0);
  swung.parameters = still.parameters;
  const std::vector<Event> events = {note_on(0, 69), parameter(5000, 0, 0.002)};
  const auto expected = heard(still, events, 8000, model);
  const auto found = heard(swung, events, 8000, model);
  const auto level = [](const std::vector<double>& y) {
    return 20.0 * std::log10(peak(std::span(y).subspan(7000, 441)));
  };
  CHECK(level(expected) > -100.0);
  CHECK(std::fabs(level(found) - level(expected)) < 1.2);
}

TEST_CASE("slow random steps give each note a value of its own, from its start", "[lfo]") {
  const LfoSetting lfo{.name = "v", .lfo = {.rate_hz = 0.01, .shape = LfoShape::steps}};
  Preset preset = moved(lfo, "K", 0.9, 1.1);
  preset.parameters.push_back({.name = "K", .value = 0.004, .minimum = 0.001, .maximum = 0.008});
  std::vector<double> notes;
  for (int before = 0; before < 8; ++before) {
    std::vector<Event> events;
    for (int i = 0; i < before; ++i) {  // silent notes, which have numbers
      events.push_back(note_on(0, 60, 1e-12));
      events.push_back(note_off(0, 60));
    }
    events.push_back(note_on(0, 69));
    const auto cents = cents_of(heard(preset, events, 22050, stiff));
    REQUIRE(!cents.empty());
    notes.push_back(cents.back().value);
    CHECK(cents.front().value == Approx(notes.back()).margin(0.1));
    CHECK(notes.back() > 600.0 * std::log2(0.9));
    CHECK(notes.back() < 600.0 * std::log2(1.1));
  }
  std::sort(notes.begin(), notes.end());
  CHECK(std::adjacent_find(notes.begin(), notes.end(),
                           [](double a, double b) { return b - a < 1e-3; }) == notes.end());
  CHECK(notes.back() - notes.front() > 50.0);  // of 174
}

TEST_CASE("the rate differs from note to note by its deviation, and repeats", "[lfo]") {
  const LfoSetting vibrato{.name = "v", .lfo = {.rate_hz = 5.0, .deviation = 0.2}};
  const Preset preset = moved(vibrato, "pitch", -50.0, 50.0);
  const double first = rate_of(cents_of(heard(preset, one_note)), 0.1);
  const std::vector<double> both =
      heard(preset, {note_on(0, 60, 1e-12), note_on(64, 69)});  // the second note is louder
  const double second = rate_of(cents_of(both), 0.1);
  CHECK(std::fabs(first / 5.0 - 1.0) < 0.21);
  CHECK(std::fabs(second / 5.0 - 1.0) < 0.21);
  CHECK(std::fabs(first - second) > 0.02);
  CHECK(heard(preset, one_note) == heard(preset, one_note));
}

TEST_CASE("variation changes strength and time within its bounds, and keeps releases", "[lfo]") {
  constexpr std::uint32_t period = 22050;
  std::vector<Event> events;
  for (std::uint32_t i = 0; i < 20; ++i) {
    events.push_back(note_on(i * period, 69, 0.5));
    events.push_back(note_off(i * period + 10, 69));  // before the delayed note starts
  }
  Preset preset = struck(4);
  preset.damper_s = 0.05;
  const std::vector<double> plain = heard(preset, events, 20 * period);
  preset.varied_strength = 0.1;
  preset.varied_ms = 20.0;
  const std::vector<double> y = heard(preset, events, 20 * period);
  CHECK(y == heard(preset, events, 20 * period));
  const double usual = peak(std::span(plain).first(period));
  double least = 1e9;
  double most = 0.0;
  double earliest = 1e9;
  double latest = 0.0;
  for (std::uint32_t i = 0; i < 20; ++i) {
    const std::span<const double> note = std::span(y).subspan(i * period, period);
    const double strength = peak(note) / usual;
    least = std::min(least, strength);
    most = std::max(most, strength);
    const double start = static_cast<double>(
        std::find_if(note.begin(), note.end(),
                     [&](double sample) { return std::fabs(sample) > 0.02 * usual; }) -
        note.begin());
    earliest = std::min(earliest, start);
    latest = std::max(latest, start);
    CHECK(peak(note.subspan(period - 2000)) < 1e-4 * usual);  // the key is up
  }
  CHECK(least > 0.899);
  CHECK(most < 1.101);
  CHECK(most - least > 0.1);  // 20 numbers in a range of 0.2 span less with odds of 2e-5
  CHECK(latest < 0.02 * 44100 + 20);
  CHECK(latest - earliest > 0.01 * 44100);
}

}  // namespace ressort::lfo_test
