// Noise: the level, band and decay of a burst, the noise of a bow, and controls of key releases,
// all measured on the engine's output.
#include "core/noise.h"

#include <complex>

#include "tests/support/networks/reference_network.h"
#include "tests/support/player.h"

namespace ressort::noise_test {
namespace {

using namespace support;

constexpr double pi = std::numbers::pi;

// Output 1 is the driven input itself; the mass beside it has the pitch.
const std::string bare_input =
    "@in1 posInput 0.\n@out1 posOutput @in1\n@g ground 0.\n@m mass 1. 0. 0.\n"
    "@k springDamper @g @m 0.01 0.0001\n@out2 posOutput @m\n";

ControlSetting noise_of(double level, double t60_ms, double low_hz, double high_hz) {
  return {.target = "in1",
          .gesture = Gesture::noise,
          .low = 0.0,
          .high = level,
          .longest_ms = t60_ms,
          .shortest_ms = t60_ms,
          .low_hz = low_hz,
          .high_hz = high_hz};
}

Preset played(const ControlSetting& control) {
  Preset preset;
  preset.keyboard = false;
  preset.controls.push_back(control);
  return preset;
}

double rms(std::span<const double> y) {
  double sum = 0.0;
  for (const double sample : y) {
    sum += sample * sample;
  }
  return std::sqrt(sum / static_cast<double>(y.size()));
}

double in_db(double ratio) {
  return 20.0 * std::log10(ratio);
}

// Undoes the decay of bursts that start every `period` frames.
std::vector<double> without_decay(std::vector<double> y, std::size_t period, double t60_frames) {
  for (std::size_t n = 0; n < y.size(); ++n) {
    y[n] *= std::pow(10.0, 3.0 * static_cast<double>(n % period) / t60_frames);
  }
  return y;
}

// Mean power in Hann windows of `size` frames at one frequency.
double power_in_bin(std::span<const double> y, std::size_t size, double hz, double rate_hz) {
  double power = 0.0;
  std::size_t windows = 0;
  for (std::size_t at = 0; at + size <= y.size(); at += size / 2) {
    std::complex<double> sum = 0.0;
    for (std::size_t n = 0; n < size; ++n) {
      const double t = static_cast<double>(n);
      const double window = 1.0 - std::cos(2.0 * pi * (t + 0.5) / static_cast<double>(size));
      sum += y[at + n] * window * std::polar(1.0, -2.0 * pi * hz / rate_hz * t);
    }
    power += std::norm(sum);
    ++windows;
  }
  return power / static_cast<double>(windows);
}

// The mean of three bins, for a third of the variance.
double power_at(std::span<const double> y, std::size_t size, double hz, double rate_hz) {
  const double bin_hz = rate_hz / static_cast<double>(size);
  double power = 0.0;
  for (const double offset : {-1.0, 0.0, 1.0}) {
    power += power_in_bin(y, size, hz + offset * bin_hz, rate_hz) / 3.0;
  }
  return power;
}

}  // namespace

TEST_CASE("a burst of noise has its level and its band at any sample rate", "[noise]") {
  constexpr double low_hz = 500.0;
  constexpr double high_hz = 5000.0;
  constexpr double level = 0.25;
  for (const double rate_hz : {44100.0, 96000.0}) {
    CAPTURE(rate_hz);
    Player player(bare_input, played(noise_of(level, 10'000.0, low_hz, high_hz)),
                  {.rate_hz = rate_hz});
    const auto period = static_cast<std::size_t>(2.0 * rate_hz);
    std::vector<Event> events;
    for (std::uint32_t note = 0; note < 10; ++note) {
      events.push_back(note_on(note * static_cast<std::uint32_t>(period), 60));
    }
    player.run(10 * period, events);
    const std::vector<double> y = without_decay(player.y(), period, 10.0 * rate_hz);
    CHECK(std::fabs(in_db(rms(y) / level)) < 0.5);
    // At its frequency, a one-pole filter halves the power. The other one takes 1 % more, and 10 %
    // away the power differs by 10 %.
    const auto size = static_cast<std::size_t>(0.02 * rate_hz);
    const double middle = power_at(y, size, 1600.0, rate_hz) * 1.2;  // 0.83 by both filters
    CHECK(power_at(y, size, low_hz, rate_hz) / middle == Approx(0.495).epsilon(0.1));
    CHECK(power_at(y, size, high_hz, rate_hz) / middle == Approx(0.495).epsilon(0.1));
    CHECK(power_at(y, size, 200.0, rate_hz) / middle == Approx(1.0 / 7.25).epsilon(0.2));
    CHECK(player.heap_calls == 0);
  }
}

TEST_CASE("a force has the level of its noise, whatever the sample rate", "[noise]") {
  // Far below its resonance of 3.5 kHz, the mass moves by F/K.
  const std::string stiff =
      "@g ground 0.\n@m mass 1. 0. 0.\n@k springDamper @g @m 0.25 0.5\n@in1 frcInput @m\n"
      "@out1 posOutput @m\n";
  for (const double rate_hz : {44100.0, 96000.0}) {
    CAPTURE(rate_hz);
    Player player(stiff, played(noise_of(0.1, 10'000.0, 50.0, 200.0)), {.rate_hz = rate_hz});
    player.run(static_cast<std::size_t>(4.0 * rate_hz), {note_on(0, 60)});
    const std::vector<double> y = without_decay(player.y(), player.y().size(), 10.0 * rate_hz);
    CHECK(std::fabs(in_db(rms(y) / (0.1 / 0.25))) < 0.5);
  }
}

TEST_CASE("a burst decays by its T60 and ends, and the key's pitch does not change it", "[noise]") {
  for (const int key : {36, 96}) {
    CAPTURE(key);
    Preset preset = played(noise_of(1.0, 200.0, 500.0, 8000.0));
    preset.keyboard = true;
    Player player(bare_input, preset);
    player.run(30'000, {note_on(0, key)});
    // Mean of the squared envelope over the first quarter of T60: (1 - 10^-1.5) / (1.5 ln 10).
    const std::span<const double> y = player.y();
    const double start = std::sqrt((1.0 - std::pow(10.0, -1.5)) / (1.5 * std::numbers::ln10));
    CHECK(std::fabs(in_db(rms(y.first(2205)) / start)) < 0.8);
    CHECK(std::fabs(in_db(rms(y.subspan(2205, 2205)) / start) + 15.0) < 0.8);
    CHECK(std::fabs(in_db(rms(y.subspan(4410, 2205)) / start) + 30.0) < 0.8);
    CHECK(peak(y.subspan(20'000)) == 0.0);  // below -100 dB after 14 700 frames
  }
}

TEST_CASE("bursts repeat from render to render and differ from note to note", "[noise]") {
  const Preset preset = played(noise_of(1.0, 10'000.0, 20.0, 20'000.0));
  const std::vector<Event> events = {note_on(0, 60), note_on(20'000, 60)};
  Player first(bare_input, preset);
  Player second(bare_input, preset);
  first.run(40'000, events);
  second.run(40'000, events, {64, 500, 3});
  CHECK(first.y() == second.y());
  double common = 0.0;
  for (std::size_t n = 0; n < 20'000; ++n) {
    common += first.y()[n] * first.y()[n + 20'000];
  }
  const std::span<const double> y = first.y();
  // Independent noise correlates by 1/sqrt(20 000) = 0.007.
  CHECK(std::fabs(common) / 20'000 < 0.03 * rms(y.first(20'000)) * rms(y.subspan(20'000)));
  CHECK(rms(y.first(20'000)) > 0.5);
}

TEST_CASE("a bow's speed fluctuates by its noise, and not at all without it", "[noise]") {
  constexpr double speed = 1e-4;
  const auto velocities = [&](double noise) {
    Player player(bare_input, played({.target = "in1",
                                      .gesture = Gesture::bow,
                                      .low = speed,
                                      .high = speed,
                                      .low_hz = 1000.0,
                                      .high_hz = 8000.0,
                                      .noise = noise}));
    player.run(160'000, {note_on(0, 60)});
    std::vector<double> v;
    for (std::size_t n = 10'000; n < 160'000; ++n) {  // the speed has settled
      v.push_back((player.y()[n] - player.y()[n - 1]) / speed - 1.0);
    }
    return v;
  };
  CHECK(std::fabs(in_db(rms(velocities(0.1)) / 0.1)) < 0.5);
  CHECK(peak(velocities(0.1)) < 0.6);
  CHECK(peak(velocities(0.0)) < 1e-9);
  const std::vector<double> v = velocities(0.1);
  CHECK(power_at(v, 882, 8000.0, 44100.0) / power_at(v, 882, 2800.0, 44100.0) ==
        Approx(0.61).epsilon(0.2));  // 0.494 by 0.808, by both filters
}

TEST_CASE("a control of releases plays when the key is released, or the pedal", "[noise]") {
  const ControlSetting strike{.source = ControlSource::release,
                              .target = "in1",
                              .gesture = Gesture::impulse,
                              .low = 0.0,
                              .high = 0.1};
  const auto heard = [](const ControlSetting& control, const std::vector<Event>& events) {
    Player player(ringing_string(), played(control));
    player.run(12'000, events);
    return player.y();
  };
  ControlSetting note = strike;
  note.source = ControlSource::note;
  const std::vector<double> struck = heard(note, {note_on(0, 60, 0.3)});
  const auto is_struck_at = [&](std::span<const double> y, std::size_t at) {
    double most = 0.0;
    for (std::size_t n = 0; n + at < y.size(); ++n) {
      most = std::max(most, std::fabs(y[n + at] - struck[n]));
    }
    return peak(y.first(at)) == 0.0 && most < 1e-12 * peak(struck);
  };
  CHECK(is_struck_at(heard(strike, {note_on(0, 60), note_off(4000, 60, 0.3)}), 4000));
  // The pedal holds the key; the release velocity is still the key's.
  CHECK(is_struck_at(heard(strike, {controller(0, 64, 1.0), note_on(0, 60), note_off(1000, 60, 0.3),
                                    controller(4000, 64, 0.0)}),
                     4000));
  ControlSetting higher = strike;
  higher.lowest_key = 61;
  CHECK(peak(heard(higher, {note_on(0, 60), note_off(4000, 60)})) == 0.0);
}

TEST_CASE("a release plays the released voice, not the latest one", "[noise]") {
  Preset preset = played({.source = ControlSource::release,
                          .target = "in1",
                          .gesture = Gesture::impulse,
                          .low = 0.0,
                          .high = 0.1});
  preset.keyboard = true;
  preset.voices = 2;
  Player both(ringing_string(), preset);
  both.run(12'000, {note_on(0, 48), note_on(0, 60), note_off(4000, 48)});
  Player low(ringing_string(), preset);
  low.run(12'000, {note_on(0, 48), note_off(4000, 48)});
  CHECK(peak(low.y()) > 0.0);
  CHECK(both.y() == low.y());
}

}  // namespace ressort::noise_test
