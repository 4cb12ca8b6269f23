// Gestures: the motion of an input by closed forms, of the driver alone and in the engine.
#include "core/gesture.h"

#include "core/model/preset/fit.h"
#include "tests/support/networks/reference_network.h"
#include "tests/support/player.h"

namespace ressort::gesture_test {
namespace {

using namespace support;

constexpr double smoothing_pole = 0.999;  // pole of the smoothing, 1 - 44.1/44100

// Output 1 is the driven input, output 2 the mass that it pulls.
const std::string puppet =
    "@in1 posInput 0.5\n@m mass 1. 0. 0.\n@g ground 0.\n@k param 0.01\n"
    "@l springDamper @in1 @m k 0.01\n@r springDamper @m @g 0.01 0.01\n"
    "@out1 posOutput @in1\n@out2 posOutput @m\n";

InputSample next_position(InputDriver& driver) {
  InputSample sample;
  driver.fill_positions(1, 1, &sample.value, &sample.velocity);
  return sample;
}

double next_force(InputDriver& driver) {
  double force = 0.0;
  driver.fill_forces(1, 1, &force);
  return force;
}

Preset played(const ControlSetting& control) {
  Preset preset;
  preset.keyboard = false;
  preset.controls.push_back(control);
  return preset;
}

}  // namespace

TEST_CASE("following a target is a one-pole filter that comes to rest at the target", "[gesture]") {
  InputDriver driver;
  driver.place(2.0);
  CHECK_FALSE(driver.is_moving());
  driver.follow(3.0, 0.9);
  double before = 2.0;
  for (int n = 1; n <= 100; ++n) {
    const InputSample sample = next_position(driver);
    CHECK(std::fabs(sample.value - (3.0 - std::pow(0.9, n))) < 1e-14);
    CHECK(sample.velocity == sample.value - before);
    before = sample.value;
  }
  for (int n = 0; n < 1000 && driver.is_moving(); ++n) {
    next_position(driver);
  }
  CHECK_FALSE(driver.is_moving());
  CHECK(driver.value() == 3.0);
  CHECK(next_position(driver).velocity == 0.0);
  driver.follow(-1.0, 0.0);  // pole 0 jumps
  CHECK(next_position(driver).value == -1.0);
}

TEST_CASE("a sweep has a constant speed and ends exactly at its target", "[gesture]") {
  InputDriver driver;
  driver.place(1.0);
  driver.sweep(-1.0, 0.0625);
  for (int n = 1; n <= 40; ++n) {
    const InputSample sample = next_position(driver);
    CHECK(sample.value == std::max(-1.0, 1.0 - 0.0625 * n));
    CHECK(sample.velocity == (n <= 32 ? -0.0625 : 0.0));
  }
  CHECK_FALSE(driver.is_moving());
  driver.sweep(-0.9, 0.0625);
  next_position(driver);
  CHECK(next_position(driver).value == -0.9);  // the last step is shorter
}

TEST_CASE("a drawn bow approaches its speed and keeps it exact at any distance", "[gesture]") {
  InputDriver driver;
  driver.place(0.0);
  driver.draw(0.001, 0.99);
  double position = 0.0;
  for (int n = 1; n <= 500; ++n) {
    const InputSample sample = next_position(driver);
    CHECK(std::fabs(sample.velocity - 0.001 * (1.0 - std::pow(0.99, n))) < 1e-17);
    position += sample.velocity;
    CHECK(sample.value == position);
  }
  driver.place(1e9);  // a difference of positions would lose 7 digits here
  driver.draw(0.001, 0.0);
  CHECK(next_position(driver).velocity == 0.001);
  driver.draw(0.0, 0.5);
  for (int n = 0; n < 100; ++n) {
    next_position(driver);
  }
  CHECK_FALSE(driver.is_moving());
}

TEST_CASE("pushes, strikes and held forces add up", "[gesture]") {
  InputDriver driver;
  driver.place(0.0);
  driver.push(0.5, 3);
  driver.strike(1.0);
  driver.strike(0.25);
  CHECK(next_force(driver) == 1.75);
  CHECK(next_force(driver) == 0.5);
  CHECK(next_force(driver) == 0.5);
  CHECK(next_force(driver) == 0.0);
  CHECK_FALSE(driver.is_moving());
}

TEST_CASE("a pulse grows longer without a step and keeps its sum", "[gesture]") {
  const auto pulse = [](double frames) {
    InputDriver driver;
    driver.place(0.0);
    driver.strike(3.0, frames);
    std::vector<double> force(14);
    for (double& sample : force) {
      sample = next_force(driver);
    }
    CHECK_FALSE(driver.is_moving());
    return force;
  };
  CHECK(pulse(0.2) == pulse(1.0));
  std::vector<double> before = pulse(1.0);
  for (int i = 1; i <= 1200; ++i) {
    const double frames = 1.0 + 0.01 * i;
    INFO(frames);
    const std::vector<double> force = pulse(frames);
    CHECK(std::accumulate(force.begin(), force.end(), 0.0) == Approx(3.0).epsilon(1e-12));
    for (std::size_t n = 0; n < force.size(); ++n) {
      CHECK(force[n] >= 0.0);
      // The slope is steepest between one sample and two, where a third of the pulse moves within
      // half a frame.
      CHECK(std::fabs(force[n] - before[n]) < 0.08);
      if (i % 100 == 0) {
        const double whole =
            1.0 - std::cos(2.0 * std::numbers::pi * (static_cast<double>(n) + 0.5) / frames);
        CHECK(force[n] ==
              Approx(static_cast<double>(n) < frames ? 3.0 * whole / frames : 0.0).margin(1e-12));
      }
    }
    before = force;
  }
}

TEST_CASE("a position event moves the input, smoothed as published", "[gesture]") {
  Player player(puppet, played({.target = "in1"}));
  player.run(3000, {{.frame = 101,
                     .kind = EventKind::gesture,
                     .gesture = Gesture::position,
                     .index = 1,
                     .value = 1.0}});
  for (std::size_t n = 0; n < 3000; ++n) {
    const double after = n < 101 ? 0.0 : static_cast<double>(n - 100);
    const double expected = 1.0 - 0.5 * std::pow(smoothing_pole, after);
    REQUIRE(std::fabs(player.out[0][n] - expected) < 1e-12);
  }
  // An event for another input, or a force on a position input, has no effect.
  Player deaf(puppet, played({.target = "in1"}));
  deaf.run(1000,
           {{.kind = EventKind::gesture, .gesture = Gesture::position, .index = 2, .value = 1.0},
            {.kind = EventKind::gesture, .gesture = Gesture::force, .index = 1, .value = 1.0}});
  CHECK(std::all_of(deaf.out[0].begin(), deaf.out[0].end(), [](double x) { return x == 0.5; }));
}

TEST_CASE("a note holds the input at the end of its range until it is released", "[gesture]") {
  Player player(puppet,
                played({.target = "in1", .gesture = Gesture::hold, .low = 0.25, .high = 2.0}));
  player.run(60000, {note_on(1000, 60), note_off(31000, 60)});
  CHECK(player.out[0][999] == 0.25);
  for (std::size_t n = 1000; n < 31000; ++n) {
    const double expected = 2.0 - 1.75 * std::pow(smoothing_pole, static_cast<double>(n - 999));
    REQUIRE(std::fabs(player.out[0][n] - expected) < 1e-11);
  }
  CHECK(std::fabs(player.out[0][59999] - 0.25) < 1e-11);
}

TEST_CASE("a pluck sweeps to the other side, faster when harder", "[gesture]") {
  const auto control = ControlSetting{
      .target = "in1", .gesture = Gesture::pluck, .low = 0.001, .high = 0.003, .travel = 0.25};
  Player player(puppet, played(control));
  player.run(3000, {note_on(100, 60, 0.5), note_on(1000, 60, 1.0)});
  CHECK(player.out[0][99] == 0.25);  // 0.5 is the middle
  for (std::size_t n = 100; n < 1000; ++n) {
    const double expected = std::min(0.75, 0.25 + 0.002 * static_cast<double>(n - 99));
    REQUIRE(std::fabs(player.out[0][n] - expected) < 1e-13);
  }
  for (std::size_t n = 1000; n < 3000; ++n) {
    const double expected = std::max(0.25, 0.75 - 0.003 * static_cast<double>(n - 999));
    REQUIRE(std::fabs(player.out[0][n] - expected) < 1e-13);
  }
  // The speed per second is the same at another rate.
  Player fast(puppet, played(control), {.rate_hz = 88200.0});
  fast.run(1000, {note_on(0, 60, 0.5)});
  CHECK(std::fabs(fast.out[0][99] - (0.25 + 0.001 * 100)) < 1e-13);
}

TEST_CASE("a bowed note draws until its key is released", "[gesture]") {
  Player player(puppet,
                played({.target = "in1", .gesture = Gesture::bow, .low = 0.0, .high = 1e-4}));
  player.run(20000, {note_on(0, 60, 0.5), note_off(10000, 60)});
  const double pole = std::exp(-1.0 / (0.005 * 44100.0));
  for (std::size_t n = 1; n < 10000; ++n) {
    const double speed = player.out[0][n] - player.out[0][n - 1];
    const double expected = 0.5e-4 * (1.0 - std::pow(pole, static_cast<double>(n + 1)));
    REQUIRE(std::fabs(speed - expected) < 1e-15);
  }
  CHECK(player.out[0][19999] == player.out[0][19998]);
}

TEST_CASE("the level of a bow's stroke rises in a straight line within its length", "[gesture]") {
  // The output is the bow's position, which is 0 without a stroke.
  const std::string bow = "@in1 posInput 0." + puppet.substr(puppet.find("\n"));
  const auto drawn = [&](double longest_ms, double shortest_ms) {
    Preset preset = played({.target = "in1",
                            .gesture = Gesture::bow,
                            .low = 1e-4,
                            .high = 1e-4,
                            .has_level = true,
                            .low_db = 0.0,
                            .high_db = 0.0,
                            .longest_ms = longest_ms,
                            .shortest_ms = shortest_ms});
    preset.keyboard = true;
    Player player(bow, preset);
    player.run(10000, {note_on(0, 60, 0.5)});
    return player.out[0];
  };
  const std::vector<double> at_once = drawn(0.0, 0.0);
  const std::vector<double> rising = drawn(200.0, 50.0);  // 100 ms at half the velocity
  for (std::size_t n = 0; n < 10000; ++n) {
    const double level = std::min(1.0, static_cast<double>(n) / 4410.0);
    REQUIRE(std::fabs(rising[n] - level * at_once[n]) <= std::fabs(at_once[n]) / 4410.0 + 1e-13);
  }
}

TEST_CASE("a bent or gliding bow keeps its speed in units of the string's motion", "[gesture]") {
  // The motion is slow against the rate: a key's frequency is proportional to sqrt(K), except for
  // w^2 / 24, which is at most 3e-4.
  const std::string slow =
      "@in1 posInput 0.\n@m mass 1. 0. 0.\n@g ground 0.\n@r springDamper @m @g 0.0001 0.\n"
      "@b nlBow @in1 @m 0.01 0.001\n@out1 posOutput @in1\n";
  Preset preset = played({.source = ControlSource::note,
                          .target = "in1",
                          .gesture = Gesture::bow,
                          .low = 1e-4,
                          .high = 1e-4});
  preset.keyboard = true;
  preset.mono = preset.legato = true;
  Player player(slow, preset);
  const double written_hz = player.compiled.instrument.mode->frequency_hz;
  // The speed follows the held key, whatever events came before, after the 5 ms of smoothing.
  const auto speed = [&](const std::vector<Event>& events) {
    player.run(10000, events);
    return player.y().back() - player.y()[player.y().size() - 2];
  };
  const double at_60 = 1e-4 * 440.0 * std::exp2(-9.0 / 12.0) / written_hz;
  CHECK(speed({note_on(0, 60)}) == Approx(at_60).epsilon(4e-4));
  const Event up = {.kind = EventKind::bend, .value = 1.0};
  CHECK(speed({up}) == Approx(at_60 * std::exp2(2.0 / 12.0)).epsilon(4e-4));
  CHECK(speed({note_on(0, 72)}) == Approx(at_60 * std::exp2(14.0 / 12.0)).epsilon(4e-4));
  CHECK(speed({note_off(0, 72)}) == Approx(at_60 * std::exp2(2.0 / 12.0)).epsilon(4e-4));
}

TEST_CASE("controllers, pressure and OSC names drive their targets by the preset's curve",
          "[gesture]") {
  Preset preset = played({.source = ControlSource::controller,
                          .number = 20,
                          .target = "k",
                          .gesture = Gesture::parameter,
                          .low = 0.01,
                          .high = 0.05});
  preset.controls.push_back({.source = ControlSource::pressure,
                             .target = "k",
                             .gesture = Gesture::parameter,
                             .low = 0.01,
                             .high = 0.04,
                             .exponential = true});
  preset.controls.push_back({.source = ControlSource::osc,
                             .address = "/finger",
                             .target = "in1",
                             .low = -1.0,
                             .high = 1.0});
  Player player(puppet, preset);
  const auto k_after = [&](Event event) {
    player.run(300, {event});
    return player.engine().parameter(0);
  };
  CHECK(k_after(controller(0, 20, 0.25)) == 0.02);
  CHECK(k_after(controller(0, 21, 0.75)) == 0.02);
  CHECK(k_after({.kind = EventKind::pressure, .value = 0.5}) == Approx(0.02).epsilon(1e-14));
  CHECK(k_after({.kind = EventKind::pressure, .value = 2.0}) == Approx(0.04).epsilon(1e-14));
  REQUIRE(player.compiled.instrument.custom.size() == 1);
  CHECK(player.compiled.instrument.custom[0].address == "/finger");
  const auto row = static_cast<std::uint16_t>(player.compiled.instrument.custom[0].row);
  player.run(60000, {{.kind = EventKind::custom, .index = row, .value = 0.125}});
  CHECK(player.out[0].back() == Approx(-0.75).epsilon(1e-11));
}

TEST_CASE("a force lasts for its duration and has the same effect at every rate", "[gesture]") {
  // A free mass: a force F over N samples gives it the speed F N per sample.
  const std::string free_mass = "@m mass 2. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  const auto at_one_second = [&](double rate_hz, double force, double seconds) {
    Preset preset = played({.target = "in1", .gesture = Gesture::impulse});
    preset.gain = 1e-5;  // keeps the mass within the bounds of a stable voice
    Player player(free_mass, preset, {.rate_hz = rate_hz});
    player.run(static_cast<std::size_t>(rate_hz), {{.kind = EventKind::gesture,
                                                    .gesture = Gesture::force,
                                                    .index = 1,
                                                    .value = force,
                                                    .value2 = seconds}});
    return player.y().back() / preset.gain;
  };
  CHECK(at_one_second(44100.0, 0.5, 0.0) == Approx(0.25 * 44100).epsilon(1e-9));
  CHECK(at_one_second(88200.0, 0.5, 0.0) == Approx(0.25 * 44100).epsilon(1e-9));
  const double frames = 441.0;  // of 10 ms: F/M (N (N+1)/2 + N (1 s - N))
  const double held = 0.25 * (frames * (frames + 1) / 2 + frames * (44100 - frames));
  CHECK(at_one_second(44100.0, 0.5, 0.01) == Approx(held).epsilon(1e-9));
  CHECK(at_one_second(88200.0, 0.5, 0.01) == Approx(held).epsilon(1e-4));
}

TEST_CASE("a blow on a position is a displacement of one sample, with the velocity of both steps",
          "[gesture]") {
  InputDriver driver;
  driver.place(0.5);
  driver.strike(0.25);
  const InputSample away = next_position(driver);
  const InputSample back = next_position(driver);
  const InputSample rest = next_position(driver);
  CHECK(away.value == 0.75);
  CHECK(away.velocity == 0.25);
  CHECK(back.value == 0.5);
  CHECK(back.velocity == -0.25);
  CHECK(rest.velocity == 0.0);
  CHECK_FALSE(driver.is_moving());
}

TEST_CASE("audio is added to the input's position; in the bare network it replaces it",
          "[gesture]") {
  Preset preset = played(
      {.source = ControlSource::audio, .number = 2, .target = "in1", .low = 0.0, .high = 0.5});
  Player player(puppet, preset);
  std::vector<double> audio(2000);
  const Motion motion(9, 5.0, 500.0);
  for (std::size_t n = 0; n < audio.size(); ++n) {
    audio[n] = motion(n);
  }
  const double* const channels[] = {nullptr, audio.data()};
  player.run(2000, {}, {97}, channels);
  Player bare(puppet, preset, {.bare = true});
  bare.run(2000, {}, {97}, channels);
  const Network network = network_of(puppet);
  auto moved = reference::make_simulation(network, parameter_values(network));
  auto driven = reference::make_simulation(network, parameter_values(network));
  Comparison error;
  for (std::size_t n = 0; n < audio.size(); ++n) {
    REQUIRE(player.out[0][n] == 0.5 + 0.5 * audio[n]);
    REQUIRE(bare.out[0][n] == 0.5 * audio[n]);
    // The pulled mass reacts to the velocity of the input.
    const double from_rest[] = {0.5 + 0.5 * audio[n]};
    const double as_it_is[] = {0.5 * audio[n]};
    error.add(moved.simulator.step(from_rest)[1], player.out[1][n]);
    error.add(driven.simulator.step(as_it_is)[1], bare.out[1][n]);
  }
  INFO(show(error.relative()));
  CHECK(error.relative() < 1e-12);
  CHECK(player.compiled.instrument.audio_inputs == 2);
  // An unconnected channel leaves the input at its position.
  Player quiet(puppet, preset);
  const double* const nothing[] = {nullptr, nullptr};
  quiet.run(100, {}, {50}, nothing);
  CHECK(quiet.out[0][99] == 0.5);
}

TEST_CASE("audio drives the inputs of one voice of many like those of a single voice",
          "[gesture]") {
  // Two force inputs and a position input. Audio drives all of them or all but the last; the driver
  // rests or moves.
  const std::string text = scenes::triangle("0.1", "0.001") +
                           "@in1 frcInput @m_m1\n@in2 frcInput @m_m2\n@in3 posInput 0.3\n"
                           "@h springDamper @in3 @m_m0 0.01 0.001\n" +
                           scenes::output(1, "m_m2");
  std::vector<double> audio(3000);
  const Motion motion(7, 1.0, 500.0);
  for (std::size_t n = 0; n < audio.size(); ++n) {
    audio[n] = 0.1 * motion(n);
  }
  const double* const channels[] = {audio.data(), audio.data() + 500, audio.data() + 1000};
  for (const int moved : {2, 3}) {
    Preset preset = default_preset(network_of(text), false);
    preset.keyboard = false;
    preset.controls.clear();
    for (int i = 1; i <= moved; ++i) {
      preset.controls.push_back({.source = ControlSource::audio,
                                 .number = i,
                                 .target = "in" + std::to_string(i),
                                 .low = 0.0,
                                 .high = i < 3 ? 0.01 : 0.5});
    }
    const std::vector<Event> events = {{.frame = 1000,
                                        .kind = EventKind::gesture,
                                        .gesture = Gesture::position,
                                        .index = 3,
                                        .value = 0.4}};
    preset.voices = 1;
    Player alone(text, preset, {.method = Method::direct});
    preset.voices = 6;
    Player among(text, preset, {.method = Method::batch});
    alone.run(2000, events, {97, 64, 1}, channels);
    among.run(2000, events, {97, 64, 1}, channels);
    Comparison error;
    for (std::size_t n = 0; n < alone.y().size(); ++n) {
      error.add(alone.y()[n], among.y()[n]);
    }
    INFO(moved << ": " << show(error.relative()));
    CHECK(peak(alone.y()) > 0.01);
    CHECK(error.relative() < 1e-12);
  }
}

// At velocity 1/2 and hardness h a blow lasts 4 ms (1/4)^(1/2 + h).
TEST_CASE("hardness shortens a blow like a higher velocity, and leaves its force", "[gesture]") {
  const auto heard = [](double longest_ms, double shortest_ms, double hardness) {
    Preset preset = played({.target = "in1",
                            .gesture = Gesture::impulse,
                            .low = 1.0,
                            .high = 1.0,
                            .longest_ms = longest_ms,
                            .shortest_ms = shortest_ms});
    preset.hardness = "touch";
    preset.parameters = {{"touch", 0.0, -1.0, 1.0}};
    auto compiled =
        compile_network(with_preset_parameters(network_of(ringing_string()), preset), preset, {});
    REQUIRE(compiled);
    const std::vector<ParameterInfo>& known = compiled->instrument.parameters;
    const auto touch = std::ranges::find(known, "touch", &ParameterInfo::name);
    const auto index = static_cast<std::uint16_t>(touch - known.begin());
    Player player(*std::move(compiled));
    player.run(4000, {{.kind = EventKind::parameter, .index = index, .value = hardness},
                      {.kind = EventKind::note_on, .index = 60, .value = 0.5}});
    return player.y();
  };
  const auto difference = [](const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0.0;
    for (std::size_t n = 0; n < a.size(); ++n) {
      most = std::max(most, std::fabs(a[n] - b[n]));
    }
    return most / peak(a);
  };
  CHECK(difference(heard(2.0, 2.0, 0.0), heard(4.0, 1.0, 0.0)) < 1e-12);
  CHECK(difference(heard(1.0, 1.0, 0.0), heard(4.0, 1.0, 0.5)) < 1e-12);
  CHECK(difference(heard(8.0, 8.0, 0.0), heard(4.0, 1.0, -1.0)) < 1e-12);
  CHECK(difference(heard(0.5, 0.5, 0.0), heard(4.0, 1.0, 1.0)) < 1e-12);
  CHECK(difference(heard(2.0, 2.0, 0.0), heard(4.0, 1.0, 0.5)) > 0.01);
}

TEST_CASE("controls of a round robin alternate from note to note", "[gesture]") {
  const std::string two = ringing_string() + "@in2 frcInput @s_m4\n";
  const auto strike = [](const char* input, double force, int turn, int turns) {
    return ControlSetting{.target = input,
                          .gesture = Gesture::impulse,
                          .low = force,
                          .high = force,
                          .turn = turn,
                          .turns = turns};
  };
  const auto heard = [&](const std::vector<ControlSetting>& controls, int notes) {
    Preset preset = played(controls[0]);
    preset.controls = controls;
    Player player(two, preset);
    std::vector<Event> events;
    for (int note = 0; note < notes; ++note) {
      events.push_back(note_on(static_cast<std::uint32_t>(1000 * note), 60 + note % 3));
    }
    player.run(5000, events);
    return player.y();
  };
  const ControlSetting down = strike("in1", 0.1, 1, 2);
  const ControlSetting up = strike("in2", -0.1, 2, 2);
  // Fixed tuning has one instrument: four alternating notes are the sum of the single
  // ones.
  const std::vector<double> both = heard({down, up}, 4);
  const std::vector<double> first = heard({down}, 4);
  const std::vector<double> second = heard({up}, 4);
  for (std::size_t n = 0; n < both.size(); ++n) {
    REQUIRE(std::fabs(both[n] - first[n] - second[n]) < 1e-12);
  }
  CHECK(peak(std::span(second).first(1000)) == 0.0);  // the other control's turn
  CHECK(peak(std::span(second).subspan(1000, 500)) > 0.0);
  // A stroke in a round robin equals the stroke without one.
  CHECK(heard({strike("in1", 0.1, 1, 2), strike("in1", 0.1, 2, 2)}, 4) ==
        heard({strike("in1", 0.1, 1, 1)}, 4));
}

TEST_CASE("the outputs modulate noise that is the same in every run", "[gesture]") {
  Preset preset = played({.target = "in1"});
  Player plain(puppet, preset);
  preset.noise = true;
  Player noisy(puppet, preset);
  Player again(puppet, preset);
  for (Player* player : {&plain, &noisy, &again}) {
    player->run(20000);
  }
  CHECK(noisy.out == again.out);
  double mean = 0.0;
  double power = 0.0;
  for (std::size_t n = 0; n < 20000; ++n) {
    const double white = noisy.out[0][n] / plain.out[0][n];
    REQUIRE(std::fabs(white) <= 1.0);
    mean += white / 20000;
    power += white * white / 20000;
  }
  CHECK(std::fabs(mean) < 0.02);  // 5 standard deviations of the mean of a uniform distribution
  CHECK(std::fabs(power - 1.0 / 3.0) < 0.011);  // 5 standard deviations of the mean of its square
}

}  // namespace ressort::gesture_test
