// Addresses, scores and patterns, and the errors for invalid ones.
#include "app/control/registry.h"

#include <set>

#include "tests/support/player.h"

namespace ressort::registry_test {
namespace {

using namespace support;

// Input 1 is plucked, input 2 bowed, input 3 a force.
const Instrument& instrument() {
  static const Instrument made = [] {
    Preset preset;
    preset.parameters = {{"s_K", 0.1, 0.05, 0.2}, {"s_Z", 0.001, 0.0, 0.01}};
    preset.lfos = {{.name = "Motor", .by = ControlSource::controller, .number = 92},
                   {.name = "slow", .by = ControlSource::controller, .number = 71},
                   {.name = "free"}};
    preset.controls = {{.target = "in1", .gesture = Gesture::pluck, .low = 0.1, .travel = 1.0},
                       {.target = "in2", .gesture = Gesture::bow},
                       {.source = ControlSource::osc, .address = "/finger", .target = "in1"},
                       {.source = ControlSource::osc,
                        .address = "/brightness",
                        .target = "s_K",
                        .gesture = Gesture::parameter,
                        .low = 0.05,
                        .high = 0.2},
                       {.source = ControlSource::osc, .address = "/both", .target = "in1"},
                       {.source = ControlSource::osc, .address = "/both", .target = "in2"},
                       {.source = ControlSource::controller,
                        .number = 71,
                        .target = "s_Z",
                        .name = "s_K",
                        .gesture = Gesture::parameter,
                        .low = 0.01,
                        .high = 0.0},
                       {.source = ControlSource::controller,
                        .number = 16,
                        .target = "in2",
                        .name = "Bow pressure",
                        .low = -1.0},
                       {.source = ControlSource::controller,
                        .number = 74,
                        .target = "s_K",
                        .name = "Brightness",
                        .help = "How bright it is",
                        .gesture = Gesture::parameter,
                        .low = 0.05,
                        .high = 0.2,
                        .exponential = true}};
    auto compiled =
        compile_network(network_of(scenes::string("s", 5, "0.1", "0.001") +
                                   "@in1 posInput 0.\n@in2 posInput 0.\n@in3 frcInput @s_m0\n"
                                   "@p nlPluck @in1 @s_m1 .1 .1\n@b nlBow @in2 @s_m2 .1 .1\n" +
                                   scenes::output(1, "s_m0")),
                        preset, {});
    REQUIRE(compiled);
    return compiled->instrument;
  }();
  return made;
}

// A message as typed.
Message call(const std::string& text) {
  const auto words = split_words(text);
  Message made{words.at(0), {}};
  for (std::size_t i = 1; i < words.size(); ++i) {
    made.arguments.push_back(to_argument(words[i]));
  }
  return made;
}

Event event(const std::string& text) {
  INFO(text);
  const auto events = to_events(call(text), instrument(), 9);
  INFO((events ? "" : events.error().message));
  REQUIRE(events);
  REQUIRE(events->size() == 1);
  CHECK((*events)[0].frame == 0);
  return (*events)[0];
}

void check(const Event& event, Gesture gesture, int index, double value, std::uint32_t model) {
  CHECK(event.kind == EventKind::gesture);
  CHECK(event.gesture == gesture);
  CHECK(event.index == index);
  CHECK(event.value == Approx(value).margin(1e-15));
  CHECK(event.model == model);
}

void check(const Event& event, EventKind kind, int index, double value, std::uint32_t model) {
  CHECK(event.kind == kind);
  CHECK(event.index == index);
  CHECK(event.value == Approx(value).margin(1e-15));
  CHECK(event.model == model);
}

void check_error(const std::string& text, const std::string& message) {
  const auto events = to_events(call(text), instrument(), 9);
  INFO(text);
  REQUIRE_FALSE(events);
  CHECK(events.error().message == message);
}

}  // namespace

TEST_CASE("every playing address becomes its event", "[registry]") {
  check(event("/note/on 60"), EventKind::note_on, 60, 100 / 127.0, 0);
  check(event("/note/on 60 127"), EventKind::note_on, 60, 1.0, 0);
  check(event("/note/on 60 0"), EventKind::note_off, 60, 0.5, 0);
  const auto of_id = [](const std::string& text, EventKind kind, int index, double value, int id,
                        double hz = 0.0) {
    const Event said = event(text);
    check(said, kind, index, value, 0);
    CHECK(int{said.channel} == (id == 0 ? 0 : 15 + id));
    CHECK(said.value2 == hz);
  };
  of_id("/note/on 60 127 0", EventKind::note_on, 60, 1.0, 0);
  of_id("/note/on 60 127 16", EventKind::note_on, 60, 1.0, 16);
  of_id("/note/off 60 127 2", EventKind::note_off, 60, 1.0, 2);
  of_id("/note/hz 1 450 127", EventKind::note_on, 69, 1.0, 1, 450.0);  // 69.39 is nearest to 69.
  of_id("/note/hz 1 20000 127", EventKind::note_on, 127, 1.0, 1, 20000.0);
  of_id("/note/hz 4 450 0", EventKind::controller, 123, 0.0, 4);
  of_id("/note/end 4", EventKind::controller, 123, 0.0, 4);
  of_id("/note/bend 4 -12", EventKind::bend, 0, -0.25, 4);
  of_id("/note/pressure 4 127", EventKind::pressure, 0, 1.0, 4);
  of_id("/note/slide 4 63.5", EventKind::controller, 74, 0.5, 4);
  check(event("/note/off 127"), EventKind::note_off, 127, 0.5, 0);
  check(event("/note/off 127 0"), EventKind::note_off, 127, 0.0, 0);
  check(event("/cc 1 127"), EventKind::controller, 1, 1.0, 0);
  check(event("/pressure 0"), EventKind::pressure, 0, 0.0, 0);
  check(event("/bend -0.5"), EventKind::bend, 0, -0.5, 0);
  CHECK(event("/panic").kind == EventKind::panic);
  CHECK(event("/panic 1").kind == EventKind::panic);  // A button's value.
  // Events that name a part of the model are valid for this model only.
  check(event("/param/s_K 0.15"), EventKind::parameter, 1, 0.15, 9);
  check(event("/in/1/position -7.5"), Gesture::position, 1, -7.5, 9);
  check(event("/in/3/force 0.1"), Gesture::force, 3, 0.1, 9);
  CHECK(event("/in/3/force 0.1").value2 == 0.0);
  CHECK(event("/in/3/force 0.1 2").value2 == 2.0);
  check(event("/in/1/pluck 0.5"), Gesture::pluck, 1, 0.5, 9);
  check(event("/in/2/bow -1"), Gesture::bow, 2, -1.0, 9);
  CHECK(event("/in/2/bow 1").value2 < 0.0);  // The pressure stays unchanged.
  CHECK(event("/in/2/bow 1 0.25").value2 == 0.25);
  check(event("/finger 0.5"), EventKind::custom, 2, 0.5, 9);
  const auto both = to_events(call("/both 0.25"), instrument(), 9);
  REQUIRE(both);
  REQUIRE(both->size() == 2);
  check((*both)[0], EventKind::custom, 4, 0.25, 9);
  check((*both)[1], EventKind::custom, 5, 0.25, 9);
  check(event("/brightness 1"), EventKind::custom, 3, 1.0, 9);
}

TEST_CASE("a named control moves its controller", "[registry]") {
  check(event("/control/brightness 0.4"), EventKind::controller, 74, 0.4, 9);
  check(event("/control/bow-pressure 1"), EventKind::controller, 16, 1.0, 9);
  const auto several = to_events(call("/control/b* 0.25"), instrument(), 9);
  REQUIRE(several);
  CHECK(several->size() == 2);
  check_error("/control/bright 1",
              "/control/bright: the preset has no such control; it has brightness, s_k, "
              "bow-pressure, motor");
  check_error("/control/brightness 1.5",
              "/control/brightness: the value must lie between 0 and 1, found 1.5");
}

TEST_CASE("named controls come in the usual order, at the positions of their parameters",
          "[registry]") {
  const std::vector<KnobInfo>& knobs = instrument().knobs;
  REQUIRE(knobs.size() == 4);
  CHECK(knobs[0].name == "Brightness");
  CHECK(knobs[0].help == "How bright it is");
  CHECK(knobs[0].address() == "/control/brightness");
  CHECK(knobs[0].range.position_of(0.1) == Approx(0.5).epsilon(1e-12));  // 0.1 / 0.05 = 0.2 / 0.1
  CHECK(knobs[0].range.position_of(0.3) == 1.0);
  CHECK(knobs[1].controller == 71);
  CHECK(knobs[1].range.position_of(0.0025) == Approx(0.75).epsilon(1e-12));
  CHECK_FALSE(knobs[2].parameter);
  CHECK(knobs[2].rest == 0.5);                    // the input starts at 0 of -1 to 1
  CHECK(knobs[3].address() == "/control/motor");  // scales an LFO, and has no other name
}

TEST_CASE("masses are struck by name, those of macros by number", "[registry]") {
  Preset preset;
  preset.controls = {{.target = "in1", .gesture = Gesture::impulse, .low = 0.1, .high = 0.4}};
  const auto compiled =
      compile_network(network_of("@a mass 1. 0. 0.\n@s string 5 1. 0.1 0.001 0. 0. 0.\n"
                                 "@far mass 1. 0. 0.\n@l springDamper @a [@s 0.5] 0.1 0.\n"
                                 "@in1 frcInput @a\n@out1 posOutput @a\n"),
                      preset, {});
  REQUIRE(compiled);
  const auto said = [&](const std::string& text) {
    return to_events(call(text), compiled->instrument, 9);
  };
  const auto struck = [&](const std::string& text) {
    INFO(text);
    const auto events = said(text);
    REQUIRE(events);
    REQUIRE(events->size() == 1);
    CHECK((*events)[0].kind == EventKind::strike);
    CHECK((*events)[0].model == 9);
    return std::pair{(*events)[0].value, (*events)[0].value2};
  };
  // The expanded network lists the string's masses after the two masses and the place on it.
  CHECK(struck("/mass/a/strike 1") == std::pair{0.4, 0.0});
  CHECK(struck("/mass/a/strike -0.5") == std::pair{-0.2, 0.0});
  CHECK(struck("/mass/s:2/strike 1") == std::pair{0.4, 4.0});
  CHECK(struck("/mass/s:4/strike") == std::pair{0.8 * 0.4, 6.0});
  CHECK(struck("/mass/s:0.5/strike 1") == std::pair{0.4, 2.0});
  const auto refused = [&](const std::string& text) {
    INFO(text);
    const auto events = said(text);
    REQUIRE_FALSE(events);
    return events.error().message;
  };
  CHECK(refused("/mass/s:1/strike") == "/mass/s:1/strike: s:1 is fixed, or no output hears it");
  const std::string there = ": the model has no such mass; it has a, s:1 to s:5, s:0.5";
  for (const std::string name :
       {"s", "s:", "s:0", "s:6", "s:x", "s:2x", "s:0.50", "a:1", "b", "", "far"}) {
    CHECK(refused("/mass/" + name + "/strike") == "/mass/" + name + "/strike" + there);
  }
  CHECK(refused("/mass/a/strike 1.1") ==
        "/mass/a/strike: the strength must lie between -1 and 1, found 1.1");
}

TEST_CASE("a parameter driven by an input cannot be set", "[registry]") {
  const auto compiled =
      compile_network(network_of("@K audioParam @in2\n@Z param 0.1\n@o osc 1 K Z 0 0\n"), {}, {});
  REQUIRE(compiled);
  const auto one = to_events(call("/param/K 0.1"), compiled->instrument, 9);
  REQUIRE_FALSE(one);
  CHECK(one.error().message == "/param/K: input 2 sets it in every sample, so no message can");
  // A pattern skips read-only addresses.
  const auto all = to_events(call("/param/* 0.1"), compiled->instrument, 9);
  REQUIRE(all);
  REQUIRE(all->size() == 1);
  CHECK((*all)[0].index == 1);
}

TEST_CASE("a parameter is limited to its range, and a pattern matches several", "[registry]") {
  CHECK(event("/param/s_K 5").value == 0.2);
  CHECK(event("/param/s_K -5").value == 0.05);
  const auto events = to_events(call("/param/s_[KZ] 0.06"), instrument(), 9);
  REQUIRE(events);
  REQUIRE(events->size() == 2);
  CHECK((*events)[0].value == 0.06);
  CHECK((*events)[1].value == 0.01);
  // A query plays nothing.
  check_error("/param/s_K", "/param/s_K: the value is missing");
  check_error("/status", "unknown address '/status'; /describe lists all addresses");
  check_error("/model/load x", "unknown address '/model/load'; /describe lists all addresses");
}

TEST_CASE("unplayable messages are reported with what was expected", "[registry]") {
  check_error("/nowhere 1", "unknown address '/nowhere'; /describe lists all addresses");
  check_error("/note/on", "/note/on: the key is missing");
  check_error("/note/on 128", "/note/on: the key must lie between 0 and 127, found 128");
  check_error("/note/on 60.5", "/note/on: the key must be a whole number, found 60.5");
  check_error("/note/off 60 64 1.5", "/note/off: the ID must be a whole number, found 1.5");
  check_error("/cc 16.5 1", "/cc: the number must be a whole number, found 16.5");
  check_error("/note/on 60 128", "/note/on: the velocity must lie between 0 and 127, found 128");
  check_error("/note/on sixty", "/note/on: the key must be a number, found 'sixty'");
  check_error("/note/on 60 100 1 1", "/note/on: too many arguments: 4, expected 3");
  check_error("/note/on 60 100 17", "/note/on: the ID must lie between 0 and 16, found 17");
  check_error("/note/hz 1 0", "/note/hz: the frequency must lie between 1 and 20000, found 0");
  check_error("/note/hz 0 440", "/note/hz: the ID must lie between 1 and 16, found 0");
  check_error("/note/bend 3", "/note/bend: the bend is missing");
  check_error("/note/off", "/note/off: the key is missing");
  check_error("/cc 1", "/cc: the value is missing");
  check_error("/cc 128 1", "/cc: the number must lie between 0 and 127, found 128");
  check_error("/pressure -1", "/pressure: the pressure must lie between 0 and 127, found -1");
  check_error("/bend 1.5", "/bend: the bend must lie between -1 and 1, found 1.5");
  check_error("/param/x 1", "/param/x: the model has no such parameter; it has s_M, s_K, s_Z");
  check_error("/param/s_K loud", "/param/s_K: the value must be a number, found 'loud'");
  check_error("/in/4/position 0", "/in/4/position: the model has the inputs 1 to 3");
  check_error("/in/x/position 0", "/in/x/position: the model has the inputs 1 to 3");
  check_error("/in/1x/position 0",
              "/in/1x/position: an input accepts /position, /force, /pluck and /bow");
  check_error("/in/1/2/position 0",
              "/in/1/2/position: an input accepts /position, /force, /pluck and /bow");
  check_error("/in/1/wiggle 0",
              "/in/1/wiggle: an input accepts /position, /force, /pluck and /bow");
  check_error("/in/1/force 1",
              "/in/1/force: input 1 accepts a position, not a force: use /in/N/position");
  check_error("/in/3/position 1",
              "/in/3/position: input 3 accepts a force, not a position: use /in/N/force");
  check_error("/in/2/pluck 1", "/in/2/pluck: input 2 has no pluck in this preset");
  check_error("/in/1/bow 1", "/in/1/bow: input 1 has no bow in this preset");
  check_error("/in/1/pluck 2", "/in/1/pluck: the strength must lie between 0 and 1, found 2");
  check_error("/in/3/force 1 -1",
              "/in/3/force: the time in seconds must lie between 0 and 3600, found -1");
  check_error("/finger 2", "/finger: the value must lie between 0 and 1, found 2");
  const Message infinite{"/in/1/position", {std::numeric_limits<double>::infinity()}};
  REQUIRE_FALSE(to_events(infinite, instrument(), 9));
  CHECK(to_events(infinite, instrument(), 9).error().message ==
        "/in/1/position: the position must be a number");
  REQUIRE_FALSE(to_events(call("/in/1/position 0"), Instrument{}, 1));
}

TEST_CASE("every row is found by its address and has an interface", "[registry]") {
  std::set<std::string> seen;
  for (const Row& row : rows()) {
    CAPTURE(row.address, row.command);
    CHECK(seen.insert(row.address.empty() ? std::string(row.command) : row.address).second);
    CHECK((row.play != nullptr || row.answer != nullptr || row.act != nullptr));
    CHECK(row.address.empty() == row.does.empty());
    CHECK((row.command.empty() || !row.command_does.empty()));
    CHECK((row.command.empty() || row.act != nullptr || row.play != nullptr));
    if (row.address.empty()) {
      continue;
    }
    std::string address = row.address;
    std::string name;
    for (const std::string hole : {"NAME", "N"}) {
      if (const auto at = address.find("/" + hole); at != std::string::npos) {
        name = hole == "N"                        ? "1"
               : address.starts_with("/mass/")    ? "s_m0"
               : address.starts_with("/control/") ? "s_k"
                                                  : "s_K";
        address.replace(at + 1, hole.size(), name);
        break;
      }
    }
    CHECK(find_row(address).row == &row);
    CHECK(find_row(address).name == name);
    CHECK(is_reserved(address));
    // The declared arguments are accepted.
    Message least{address, {}};
    for (const CallArgument& argument : row.arguments) {
      if (!argument.word.empty() && !argument.is_text) {
        least.arguments.emplace_back(std::isfinite(argument.least) ? argument.least : 0.0);
      }
    }
    const Events events = to_events(least, instrument(), 9);
    const std::string why = events ? "" : events.error().message;
    CAPTURE(why);
    CHECK((row.play != nullptr || why.starts_with("unknown address")));
    CHECK((row.play == nullptr || events || why.find(": input 1 ") != why.npos));
    least.arguments.resize(most_arguments + 1, 0.0);
    CHECK(static_cast<bool>(to_events(least, instrument(), 9)) == row.ignores_more);
  }
  CHECK(find_row("/nowhere").row == nullptr);
  CHECK(is_reserved("/done"));
  CHECK_FALSE(is_reserved("/finger"));
}

TEST_CASE("every live gesture has an address and is named as in presets", "[registry]") {
  for (const GestureRow& gesture : gestures) {
    const Row* const row = find_row("/in/1/" + std::string(gesture.name)).row;
    REQUIRE((row != nullptr) == (gesture.live != Live::never));
    CHECK((gesture.goal != nullptr || gesture.play != nullptr ||
           gesture.gesture == Gesture::parameter));
    CHECK((gesture.live != Live::never || !gesture.does.empty()));
    if (row != nullptr) {
      CHECK(row->gesture == gesture.gesture);
      CHECK(row->command.empty() == gesture.command.empty());
    }
  }
}

TEST_CASE("words are split at blanks outside quotes", "[registry]") {
  using Words = std::vector<std::string>;
  CHECK(split_words("") == Words{});
  CHECK(split_words(" \t ") == Words{});
  CHECK(split_words("a  b\tc\r") == Words{"a", "b", "c"});
  CHECK(split_words("load \"my model\" x") == Words{"load", "my model", "x"});
  CHECK(split_words("\"\" \"open") == Words{"", "open"});
  bool is_open = true;
  split_words("load \"my model\"", &is_open);
  CHECK(!is_open);
  split_words("load \"", &is_open);
  CHECK(is_open);
  const auto score = parse_score("0 /note/on 60\n1 /model/load \"my model\n");
  REQUIRE(!score);
  CHECK(score.error().line == 2);
  CHECK(score.error().column == 15);
  CHECK(score.error().message.find("quote") != std::string::npos);
  CHECK(to_argument("1e-3") == Argument{0.001});
  CHECK(to_argument("1x") == Argument{std::string("1x")});
  CHECK(to_argument("nan") == Argument{std::string("nan")});
}

TEST_CASE("a score line is a time and an address", "[registry]") {
  const auto score = parse_score(
      "# a score\n"
      "0 /note/on 60 100\n"
      "\n"
      "  0.25\t/param/m_K 0.12  # a comment\r\n"
      "1e1 /model/load \"my model\"");
  REQUIRE(score);
  REQUIRE(score->size() == 3);
  CHECK((*score)[0].line == 2);
  CHECK((*score)[0].column == 3);
  CHECK((*score)[1].column == 8);
  CHECK((*score)[0].time_s == 0.0);
  CHECK((*score)[0].message.address == "/note/on");
  CHECK((*score)[0].message.arguments == std::vector<Argument>{60.0, 100.0});
  CHECK((*score)[1].line == 4);
  CHECK((*score)[1].time_s == 0.25);
  CHECK((*score)[1].message.arguments == std::vector<Argument>{0.12});
  CHECK((*score)[2].time_s == 10.0);
  CHECK((*score)[2].message.arguments == std::vector<Argument>{std::string("my model")});
  CHECK(parse_score("")->empty());

  const auto wrong = [](const std::string& text, int line, int column, const std::string& message) {
    const auto read = parse_score(text);
    INFO(text);
    REQUIRE_FALSE(read);
    CHECK(read.error().message == message);
    CHECK(read.error().line == line);
    CHECK(read.error().column == column);
  };
  wrong("0 /panic\nsoon /panic", 2, 1,
        "found 'soon' where a time in seconds was expected, at most a day");
  wrong("-1 /panic", 1, 1, "found '-1' where a time in seconds was expected, at most a day");
  wrong("0.5", 1, 5, "expected an address such as /note/on after the time");
  wrong("\n0.5 note", 2, 5, "expected an address such as /note/on after the time");
  wrong("  0.5\t note", 1, 8, "expected an address such as /note/on after the time");
  wrong("\t soon", 1, 3, "found 'soon' where a time in seconds was expected, at most a day");
}

TEST_CASE("patterns match according to the OSC specification", "[registry]") {
  CHECK(fits("/a/b", "/a/b"));
  CHECK_FALSE(fits("/a/b", "/a/bc"));
  CHECK_FALSE(fits("/a/bc", "/a/b"));
  CHECK(fits("*", "m_K"));
  CHECK(fits("m_*", "m_K"));
  CHECK(fits("m_*", "m_"));
  CHECK(fits("*_K", "string_K"));
  CHECK(fits("*a*b*", "xxaxxbxx"));
  CHECK_FALSE(fits("*a*b*", "xxbxxaxx"));
  CHECK_FALSE(fits("/*", "/a/b"));  // A star does not match a slash.
  CHECK(fits("/*/b", "/a/b"));
  CHECK(fits("m_?", "m_K"));
  CHECK_FALSE(fits("m_?", "m_"));
  CHECK_FALSE(fits("a?b", "a/b"));
  CHECK(fits("m_[A-L]", "m_K"));
  CHECK_FALSE(fits("m_[!A-L]", "m_K"));
  CHECK(fits("m_[!A-L]", "m_Z"));
  CHECK(fits("m_[XYK]", "m_K"));
  CHECK(fits("{m,s}_K", "s_K"));
  CHECK_FALSE(fits("{m,s}_K", "t_K"));
  CHECK(fits("m_{K,Zo,Z}", "m_Z"));
  CHECK(fits("", ""));
  CHECK_FALSE(fits("", "a"));
  CHECK(fits("**", "abc"));
}

TEST_CASE("patterns match in bounded time and memory", "[registry]") {
  // An exponential search would exceed the test's time limit.
  const std::string name(5000, 'a');
  std::string stars;
  for (int i = 0; i < 2000; ++i) {
    stars += "*a";
  }
  CHECK(fits(stars, name));
  CHECK_FALSE(fits(stars + "b", name));
  support::Random random(21);
  const std::string letters = "ab/*?[]{},!-";
  for (int i = 0; i < 50000; ++i) {
    std::string pattern;
    for (std::size_t k = random.below(14); k-- > 0;) {
      pattern += letters[random.below(letters.size())];
    }
    const bool once = fits(pattern, "ab/a");
    REQUIRE(fits(pattern, "ab/a") == once);
    if (pattern.find_first_of("*?[]{}") == std::string::npos) {
      REQUIRE(once == (pattern == "ab/a"));
    }
  }
}

}  // namespace ressort::registry_test
