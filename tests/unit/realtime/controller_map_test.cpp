// Mapped controllers, from MIDI bytes to the values of a playing engine.
#include "tests/support/app/process_harness.h"

namespace ressort::controller_map_test {
namespace {

using namespace support;
using Bytes = std::vector<std::uint8_t>;

constexpr double low = 0.01;
constexpr double high = 0.03;

// A process with a parameter from `low` to `high`, which starts at `low`, and a mapping.
struct Desk {
  Harness harness;
  PlayingEngine* playing = nullptr;

  explicit Desk(const std::vector<MappedController>& rows) {
    Preset preset = holding();
    preset.parameters = {{.name = "k", .value = low, .minimum = low, .maximum = high}};
    preset.controls.push_back({.source = ControlSource::controller,
                               .number = 74,
                               .target = "k",
                               .gesture = Gesture::parameter,
                               .low = low,
                               .high = high});
    playing = sounding(hand_text, preset, 1);
    harness.process.slot.offer(playing);
    ControllerMap& map = harness.process.controllers.writing();
    map.count = rows.size();
    std::copy(rows.begin(), rows.end(), map.rows.begin());
    harness.process.controllers.publish();
    harness.run(256);
    reports();
  }
  ~Desk() { CHECK(harness.heap_calls == 0); }

  double value() const { return playing->engine->parameter(0); }
  // Sends messages in one block. Returns the value after it.
  double send(const std::vector<Bytes>& messages) {
    std::vector<MidiPacket> packets;
    for (const Bytes& message : messages) {
      packets.push_back({static_cast<std::uint32_t>(packets.size()), message});
    }
    harness.run(256, 256, packets);
    return value();
  }
  double turn(std::uint8_t number, std::uint8_t amount) { return send({{0xb0, number, amount}}); }
  // Sets the parameter as OSC does.
  void set(double to) {
    CHECK(harness.now({.kind = EventKind::parameter, .index = 0, .model = 1, .value = to}));
    harness.run(256);
  }
  std::vector<Report> reports() {
    std::vector<Report> found;
    Report report;
    while (harness.process.reports.pop(report)) {
      found.push_back(report);
    }
    return found;
  }
  std::vector<MidiBytes> sent() const {
    const auto messages = harness.process.midi_out();
    return {messages.begin(), messages.end()};
  }
};

MappedTarget parameter(bool exponential = false) {
  return {.kind = EventKind::parameter,
          .exists = true,
          .has_parameter = true,
          .model = 1,
          .range = {low, high, exponential}};
}

MappedTarget action(std::uint16_t row) {
  return {.kind = EventKind::program, .exists = true, .index = row};
}

// The parameter's value at a position of the knob.
double at(double position) {
  return low + position * (high - low);
}

constexpr double rounding = 1e-15;

}  // namespace

TEST_CASE("an encoder of any kind turns a parameter over its range in 127 ticks",
          "[controller_map]") {
  struct Kind {
    ControllerMode mode;
    std::uint8_t up, down, three_up, three_down;
  };
  for (const Kind& kind : {Kind{ControllerMode::twos_complement, 1, 127, 3, 125},
                           Kind{ControllerMode::offset, 65, 63, 67, 61},
                           Kind{ControllerMode::sign_magnitude, 1, 65, 3, 67}}) {
    for (const bool exponential : {false, true}) {
      Desk desk({{{.number = 20, .mode = kind.mode}, parameter(exponential)}});
      const auto expected = [&](int ticks) {
        return exponential ? low * std::pow(high / low, ticks / 127.0) : at(ticks / 127.0);
      };
      for (int tick = 1; tick <= 127; ++tick) {
        CHECK(desk.turn(20, kind.up) == Approx(expected(tick)).margin(rounding));
      }
      CHECK(desk.value() == high);
      CHECK(desk.turn(20, kind.up) == high);
      for (int tick = 126; tick >= 0; --tick) {
        CHECK(desk.turn(20, kind.down) == Approx(expected(tick)).margin(rounding));
      }
      CHECK(desk.value() == low);
      // Several in one block, and steps of more than one.
      const Bytes up = {0xb0, 20, kind.three_up};
      CHECK(desk.send({up, up, up}) == Approx(expected(9)).margin(rounding));
      CHECK(desk.turn(20, kind.three_down) == Approx(expected(6)).margin(rounding));
    }
  }
}

TEST_CASE("an encoder continues from a value that something else has set", "[controller_map]") {
  Desk desk({{{.number = 20, .mode = ControllerMode::offset}, parameter()}});
  desk.turn(20, 65);
  desk.set(at(0.5));
  CHECK(desk.turn(20, 65) == Approx(at(0.5 + 1.0 / 127.0)).margin(rounding));
}

TEST_CASE("a knob with pickup acts once it has met or crossed the present value",
          "[controller_map]") {
  Desk desk({{{.number = 20, .picks_up = true}, parameter()}});
  desk.set(at(0.5));
  CHECK(desk.turn(20, 10) == at(0.5));
  CHECK(desk.turn(20, 50) == at(0.5));
  CHECK(desk.turn(20, 80) == Approx(at(80 / 127.0)).margin(rounding));  // crossed
  CHECK(desk.turn(20, 20) == Approx(at(20 / 127.0)).margin(rounding));
  desk.set(at(0.75));
  CHECK(desk.turn(20, 30) == at(0.75));
  CHECK(desk.turn(20, 95) == Approx(at(95 / 127.0)).margin(rounding));  // met: 0.748
  CHECK(desk.turn(20, 127) == high);
}

TEST_CASE("a pair of controllers gives a parameter 16,384 values", "[controller_map]") {
  Desk desk({{{.number = 20, .has_14_bits = true}, parameter()}});
  double before = 0.0;
  for (int n = 0; n < 16384; ++n) {
    const auto coarse = static_cast<std::uint8_t>(n >> 7);
    const auto fine = static_cast<std::uint8_t>(n & 0x7f);
    const double now = desk.send({{0xb0, 20, coarse}, {0xb0, 52, fine}});
    REQUIRE(std::fabs(now - at(n / 16383.0)) < rounding);
    REQUIRE(now > before);
    before = now;
  }
  CHECK(desk.turn(52, 0) ==
        Approx(at(127 * 128 / 16383.0)).margin(rounding));  // the low half alone
}

TEST_CASE("an NRPN moves its parameter, and RPNs keep their meaning", "[controller_map]") {
  const ControllerInput fine{.source = ControllerSource::nrpn,
                             .number = 1234,  // 9 * 128 + 82
                             .has_14_bits = true};
  ControllerInput coarse = fine;
  coarse.number = 5;
  coarse.has_14_bits = false;
  Desk desk({{fine, parameter()}, {coarse, parameter()}});
  const Bytes select = {0xb0, 99, 9, 98, 82};
  CHECK(desk.send({select, {0xb0, 6, 64}, {0xb0, 38, 3}}) ==
        Approx(at((64 * 128 + 3) / 16383.0)).margin(rounding));
  CHECK(desk.turn(38, 4) == Approx(at((64 * 128 + 4) / 16383.0)).margin(rounding));
  CHECK(desk.turn(96, 0) == Approx(at((64 * 128 + 5) / 16383.0)).margin(rounding));
  CHECK(desk.turn(97, 0) == Approx(at((64 * 128 + 4) / 16383.0)).margin(rounding));
  // Another channel has selected nothing, and another number is not mapped.
  const double before = desk.value();
  CHECK(desk.send({{0xb1, 6, 1}}) == before);
  CHECK(desk.send({{0xb0, 98, 83, 6, 1}}) == before);
  CHECK(desk.send({{0xb0, 99, 0, 98, 5, 6, 127}}) == high);
  // Data for an RPN is not for the NRPN that was selected before.
  CHECK(desk.send({{0xb0, 101, 0, 100, 0, 6, 12}}) == high);
}

TEST_CASE("a button presses once, and a panic silences", "[controller_map]") {
  const auto presses = [](const std::vector<Bytes>& messages) {
    Desk desk({{{.number = 20}, action(3)},
               {{.source = ControllerSource::note, .number = 36, .channel = 9}, action(4)}});
    std::vector<int> rows;
    for (const Bytes& message : messages) {
      desk.send({message});
    }
    for (const Report& report : desk.reports()) {
      CHECK(report.kind == Report::Kind::action);
      rows.push_back(report.index);
    }
    CHECK(desk.harness.process.meters().voices <= 1);
    return rows;
  };
  const auto to = [](std::uint8_t value) { return Bytes{0xb0, 20, value}; };
  CHECK(presses({to(127), to(0), to(127), to(0)}) == std::vector<int>{3, 3});
  CHECK(presses({to(127), to(127)}) == std::vector<int>{3, 3});  // a button without a release
  CHECK(presses({to(50), to(63), to(64), to(70), to(90), to(20)}) ==
        std::vector<int>{3});  // a knob
  CHECK(presses({{0x99, 36, 1}, {0x89, 36, 0}}) == std::vector<int>{4});
  CHECK(presses({{0x90, 36, 127}}).empty());  // on another channel it is a note

  Desk desk({{{.number = 20}, {.kind = EventKind::panic, .exists = true}}});
  desk.send({{0x90, 60, 127}});
  CHECK(desk.harness.at(100'000, {.kind = EventKind::note_on, .index = 64, .value = 1.0}));
  desk.turn(20, 127);
  desk.harness.run(110'000);
  CHECK(desk.harness.process.meters().notes == 1);  // the panic has discarded the later note
  CHECK(desk.harness.process.meters().voices == 0);
}

TEST_CASE("a controller that asks for it gets the values that it has not set itself",
          "[controller_map]") {
  const std::vector<MidiBytes> none;
  Desk desk({{{.number = 20, .sends = true}, parameter()}});
  CHECK(desk.sent() == std::vector<MidiBytes>{{0xb0, 20, 0}});  // the start value
  desk.set(high);
  CHECK(desk.sent() == std::vector<MidiBytes>{{0xb0, 20, 127}});
  desk.harness.run(256);
  CHECK(desk.sent() == none);
  desk.turn(20, 40);
  CHECK(desk.sent() == none);
  desk.set(at(40.2 / 127.0));  // the same number
  CHECK(desk.sent() == none);

  Desk fine(
      {{{.number = 20, .channel = 2, .has_14_bits = true, .sends = true}, parameter()},
       {{.source = ControllerSource::nrpn, .number = 1234, .has_14_bits = true, .sends = true},
        parameter()},
       {{.number = 30, .mode = ControllerMode::offset, .sends = true}, parameter()}});
  fine.set(at(0.75));  // 12287.25 of 16383 is 95 * 128 + 127, and 95.25 of 127
  CHECK(fine.sent() == std::vector<MidiBytes>{{0xb2, 20, 95},
                                              {0xb2, 52, 127},
                                              {0xb0, 99, 9},
                                              {0xb0, 98, 82},
                                              {0xb0, 6, 95},
                                              {0xb0, 38, 127},
                                              {0xb0, 30, 95}});
}

TEST_CASE("a controller whose target the model does not have keeps its function",
          "[controller_map]") {
  MappedTarget other = parameter();
  other.model = 2;
  Desk desk({{{.number = 64}, other}, {{.number = 66}, {}}});
  desk.send({{0xb0, 64, 127}, {0x90, 60, 127}, {0x80, 60, 0}});
  desk.harness.run(44100);
  CHECK(desk.harness.y().back() > 0.9);  // held by the pedal
  desk.send({{0xb0, 64, 0}});
  desk.harness.run(44100);
  CHECK(std::fabs(desk.harness.y().back()) < 1e-6);
}

TEST_CASE("an encoder for a controller of the preset starts at its parameter's value",
          "[controller_map]") {
  MappedTarget target = parameter();
  target.kind = EventKind::controller;
  target.index = 74;
  Desk desk({{{.number = 20, .mode = ControllerMode::offset}, target}});
  desk.set(at(0.5));
  const Bytes up = {0xb0, 20, 64 + 10};
  CHECK(desk.send({up, up}) == Approx(at(0.5 + 20.0 / 127.0)).margin(rounding));
}

}  // namespace ressort::controller_map_test
