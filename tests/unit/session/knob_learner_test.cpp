// The kind of a controller, from the messages of one turn.
#include "app/session/knob_learner.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::knob_learner_test {
namespace {

using session::KnobLearner;

ControllerInput turned(int controller, const std::vector<int>& values, int channel = 2) {
  KnobLearner learner;
  for (const int value : values) {
    learner.add(channel, controller, value);
  }
  REQUIRE(learner.found());
  CHECK(learner.found()->channel == channel);
  CHECK(learner.found()->number == controller);
  return *learner.found();
}

// Steps to the right, faster in the middle, and back, as an encoder of this mode writes them.
std::vector<int> steps(ControllerMode mode) {
  std::vector<int> values;
  for (const int step : {1, 1, 1, 2, 5, 3, 1, 1, 1, -1, -1, -2, -4, -1, -1}) {
    values.push_back(mode == ControllerMode::twos_complement ? (step + 128) % 128
                     : mode == ControllerMode::offset        ? 64 + step
                     : step > 0                              ? step
                                                             : 64 - step);
  }
  return values;
}

}  // namespace

TEST_CASE("the three kinds of encoders are told from a turn and back", "[knob_learner]") {
  using enum ControllerMode;
  for (const ControllerMode mode : {twos_complement, offset, sign_magnitude}) {
    CHECK(turned(20, steps(mode)).mode == mode);
  }
  CHECK(turned(20, {127, 127, 127}).mode == twos_complement);
  CHECK(turned(20, {63, 63, 62, 62}).mode == offset);
}

TEST_CASE("an absolute knob is none of them, wherever it is turned", "[knob_learner]") {
  for (int first = 0; first < 124; ++first) {
    CHECK(turned(20, {first, first + 1, first + 2, first + 3, first + 2, first + 1, first}).mode ==
          ControllerMode::absolute);
  }
  CHECK(turned(20, {64}).mode == ControllerMode::absolute);
  CHECK(turned(20, {127, 0, 127, 0, 127, 0}).mode == ControllerMode::absolute);  // a button
  CHECK_FALSE(turned(20, {1, 1, 1}).has_14_bits);
}

TEST_CASE("pairs of 14 bits and NRPNs are recognised", "[knob_learner]") {
  KnobLearner pair;
  for (int value = 4000; value < 5000; value += 10) {
    pair.add(0, 20, value >> 7);
    pair.add(0, 52, value & 127);
  }
  pair.add(0, 21, 3);  // another knob is touched
  CHECK(pair.found() == ControllerInput{.number = 20, .channel = 0, .has_14_bits = true});

  const auto nrpn = [](bool has_fine) {
    KnobLearner learner;
    for (const int value : {5000, 5001, 5002}) {
      learner.add(1, 99, 9);
      learner.add(1, 98, 82);
      learner.add(1, 6, value >> 7);
      if (has_fine) {
        learner.add(1, 38, value & 127);
      }
      learner.add(1, 101, 127);
      learner.add(1, 100, 127);
      learner.add(1, 6, 1);  // of no number
    }
    return *learner.found();
  };
  const int number = 9 * 128 + 82;
  for (const bool has_fine : {false, true}) {
    const ControllerInput found = nrpn(has_fine);
    CHECK(found.source == ControllerSource::nrpn);
    CHECK(found.number == number);
    CHECK(found.has_14_bits == has_fine);
  }
  KnobLearner increments;
  increments.add(0, 99, 0);
  increments.add(0, 98, 7);
  for (int i = 0; i < 5; ++i) {
    increments.add(0, 96, 0);
  }
  CHECK(increments.found() ==
        ControllerInput{.source = ControllerSource::nrpn, .number = 7, .channel = 0});
}

TEST_CASE("pedals, banks and modes are no knobs", "[knob_learner]") {
  KnobLearner learner;
  for (const int controller : {0, 32, 64, 66, 67, 6, 38, 96, 120, 123, 127}) {
    learner.add(0, controller, 127);
  }
  CHECK_FALSE(learner.found());
}

}  // namespace ressort::knob_learner_test
