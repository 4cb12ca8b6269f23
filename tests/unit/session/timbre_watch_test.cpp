// Timbre while the sound plays: the same as from a recording, at the console and by OSC.
#include "app/session/timbre/timbre_watch.h"

#include <chrono>
#include <cmath>
#include <thread>

#include "app/control/osc/server.h"
#include "tests/support/app/console_harness.h"
#include "tests/support/app/osc_client.h"

namespace ressort::timbre_watch_test {
namespace {

using namespace std::chrono_literals;

// Waits until the condition holds.
template <class Holds>
bool comes(Holds&& holds) {
  for (int i = 0; i < 2000; ++i) {
    if (holds()) {
      return true;
    }
    std::this_thread::sleep_for(5ms);
  }
  return false;
}

void same(const std::optional<double>& a, const std::optional<double>& b) {
  REQUIRE(a.has_value() == b.has_value());
  if (a) {
    CHECK(std::fabs(*a - *b) <= 1e-9 * std::max(1.0, std::fabs(*b)));
  }
}

}  // namespace

TEST_CASE("the timbre reported while a sound plays equals that of its samples", "[timbre_watch]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  harness.play();
  TimbreWatch& watch = harness.session.timbre();
  watch.listen(60s);
  REQUIRE(comes([&] { return harness.process.is_listening.is_raised(); }));
  harness.say("noteon 60 127");
  std::vector<double> heard;
  for (const std::size_t frames : {std::size_t{1}, std::size_t{100}, std::size_t{255}}) {
    for (int i = 0; i < 40; ++i) {
      for (const float sample : harness.play(frames)) {
        heard.push_back(static_cast<double>(sample));  // both channels are the same
      }
    }
  }
  const std::size_t count = (heard.size() - TimbreWatch::frame) / TimbreWatch::hop + 1;
  REQUIRE(comes([&] { return watch.since(0).size() >= count; }));
  const auto live = watch.since(0);
  REQUIRE(live.size() == count);
  FrameAnalysis offline({.rate_hz = 48000.0, .size = TimbreWatch::frame});
  for (std::size_t i = 0; i < count; ++i) {
    CHECK(live[i].number == i + 1);
    const auto expected = figures_of(
        offline.next(std::span(heard).subspan(i * TimbreWatch::hop, TimbreWatch::frame)));
    const auto figures = figures_of(live[i].timbre);
    REQUIRE(expected[figure_number("centroid_hz")]);
    for (std::size_t figure = 0; figure < figures.size(); ++figure) {
      INFO(timbre_figures()[figure].name << " of frame " << i);
      same(figures[figure], expected[figure]);
    }
  }
  CHECK(watch.since(count).empty());
  CHECK(watch.since(count - 1).size() == 1);
}

TEST_CASE("the console describes a sound in words", "[timbre_watch]") {
  const Folder folder;
  Harness harness;
  CHECK(has(harness.say("timbre"), "no model is loaded"));
  harness.say("load " + write_triangle(folder));
  harness.play();
  CHECK(has(harness.say("timbre"), "no audio is running"));
  std::size_t played = 0;
  const auto hear = [&](int periods) {
    REQUIRE(comes([&] { return harness.process.is_listening.is_raised(); }));
    for (int period = 0; period < periods; ++period) {
      played += harness.play().size();
    }
    const std::size_t last = (played - TimbreWatch::frame) / TimbreWatch::hop + 1;
    REQUIRE(comes([&] {
      const auto frames = harness.session.timbre().since(0);
      return !frames.empty() && frames.back().number >= last;
    }));
  };
  hear(60);
  CHECK(has(harness.say("timbre"), "the output is silent"));
  harness.say("noteon 72 127");
  hear(10);  // while it rings
  CHECK(has(harness.say("timbre"), " Hz, the centroid of the spectrum"));
  harness.say("panic");
  harness.say("noteon 36 127");
  hear(10);
  CHECK(has(harness.say("timbre"), "darker: "));
}

TEST_CASE("OSC sends a timbre frame every hop for the requested time", "[timbre_watch]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  harness.say("noteon 60 127");
  harness.play();
  auto server =
      OscServer::open({.port = 0}, harness.process, harness.session, [](const std::string&) {});
  REQUIRE(server);
  Client client((*server)->port());
  CHECK(client.ask(message("/timbre", {61})).address == "/error");
  const Answer lease = client.ask(message("/timbre", {30}));
  CHECK(lease.address == "/timbre.reply");
  REQUIRE(comes([&] { return harness.process.is_listening.is_raised(); }));
  std::vector<double> heard;
  for (int i = 0; i < 20; ++i) {
    for (const float sample : harness.play()) {
      heard.push_back(static_cast<double>(sample));
    }
  }
  const auto frame = client.receive();
  REQUIRE(frame);
  CHECK(frame->address == "/timbre.frame");
  FrameAnalysis offline({.rate_hz = 48000.0, .size = TimbreWatch::frame});
  const auto expected = figures_of(offline.next(std::span(heard).first(TimbreWatch::frame)));
  REQUIRE(frame->values.size() == 1 + figure_number("inharmonicity"));
  CHECK(std::get<std::int32_t>(frame->values[0]) == 1);
  for (std::size_t i = 1; i < frame->values.size(); ++i) {
    INFO(timbre_figures()[i - 1].name);
    CHECK(std::get<float>(frame->values[i]) == static_cast<float>(expected[i - 1].value_or(0.0)));
  }
  client.send(message("/unsubscribe"));
  REQUIRE(comes([&] { return client.receive()->address == "/done"; }));
}

TEST_CASE("figures have words, thousands commas", "[timbre_watch]") {
  CHECK(with_commas(1812.4, 0) == "1,812");
  CHECK(with_commas(-1234567.891, 2) == "-1,234,567.89");
  CHECK(with_commas(999.0, 0) == "999");
  CHECK(with_commas(-999.0, 0) == "-999");
  FigureValues now(timbre_figures().size());
  CHECK(timbre_words(now).empty());
  now[figure_number("centroid_hz")] = 1812.0;
  now[figure_number("odd_to_even")] = 12.0;
  const auto words = timbre_words(now);
  REQUIRE(words.size() == 2);
  CHECK(words[0] == "bright: 1,812 Hz, the centroid of the spectrum");
  CHECK(has(words[1], "hollow: 12.00 times"));
  FigureValues before = now;
  before[figure_number("centroid_hz")] = 1204.0;
  CHECK(timbre_words(now, {}, before)[0] ==
        "brighter: 1,812 Hz, the centroid of the spectrum; was 1,204 Hz");
  CHECK(timbre_words(now, {}, now)[0] == words[0]);
}

}  // namespace ressort::timbre_watch_test
