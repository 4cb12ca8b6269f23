// Scala's scales and keyboard maps: values and errors.
#include "core/model/tuning/scala.h"

#include <cmath>
#include <string>

#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::scala_test {
namespace {

using namespace support;

// Ptolemy's intense diatonic in the style of the archive: comments, blanks, words after numbers.
const std::string just =
    "! ptolemy.scl\n!\nIntense Diatonic Syntonon, also Zarlino's scale\n 7\n!\n 9/8\n 5/4 third\n"
    " 4/3\n 701.955 cents\n 5/3\n 15/8\n 2/1\n";

double cents(double a_hz, double b_hz) {
  return 1200.0 * std::log2(a_hz / b_hz);
}

std::string error_of(const std::string& scale, const std::string& map = "") {
  const auto shown = [](const Error& error) {
    return std::to_string(error.line) + ":" + std::to_string(error.column) + ": " + error.message;
  };
  if (!map.empty()) {
    const auto parsed = parse_keyboard_map(map);
    return parsed ? "" : shown(parsed.error());
  }
  const auto parsed = parse_scale(scale);
  return parsed ? "" : shown(parsed.error());
}

std::vector<double> keys_of(const std::string& scale, const std::string& map = "") {
  const auto parsed = parse_scale(scale);
  REQUIRE(parsed);
  KeyboardMap keyboard;
  if (!map.empty()) {
    const auto read = parse_keyboard_map(map);
    REQUIRE(read);
    keyboard = *read;
  }
  const auto keys = key_frequencies(*parsed, map.empty() ? usual_map(*parsed) : keyboard);
  REQUIRE(keys);
  REQUIRE(keys->size() == 128);
  return *keys;
}

}  // namespace

TEST_CASE("steps of a scale are ratios, integers or cents", "[scala]") {
  const auto scale = parse_scale(just);
  REQUIRE(scale);
  REQUIRE(scale->cents.size() == 7);
  CHECK(scale->cents[1] == Approx(386.3137138648348).epsilon(1e-14));
  CHECK(scale->cents[3] == 701.955);
  CHECK(scale->cents[6] == Approx(1200.0).epsilon(1e-14));
  const auto other = parse_scale("x\r\n3\r\n100.\r\n-5.0\r\n\t2\r\n");
  REQUIRE(other);
  CHECK(other->cents == std::vector<double>{100.0, -5.0, 1200.0});
  CHECK(parse_scale("\n1\n2"));  // the description may be empty
}

TEST_CASE("without a keyboard map, middle C plays step 0", "[scala]") {
  const auto keys = keys_of(just);
  const double c_hz = 440.0 * std::exp2(-9.0 / 12.0);
  CHECK(keys[60] == Approx(c_hz).epsilon(1e-13));
  CHECK(keys[62] == Approx(c_hz * 5.0 / 4.0).epsilon(1e-13));
  CHECK(keys[67] == Approx(c_hz * 2.0).epsilon(1e-13));
  CHECK(keys[59] == Approx(c_hz * 15.0 / 16.0).epsilon(1e-13));
  CHECK(keys[53] == Approx(c_hz / 2.0).epsilon(1e-13));
  CHECK(keys[45] == Approx(c_hz / 4.0 * 15.0 / 16.0).epsilon(1e-13));
}

TEST_CASE("a keyboard map assigns steps and the reference pitch", "[scala]") {
  // The white keys play the seven steps, the black keys none; A is 432 Hz.
  const std::string white =
      "! white.kbm\n12\n0\n127\n60\n69\n432.0\n7\n0\nx\n1\nx\n2\n3\nx\n4\nx\n5\nx\n6\n";
  const auto keys = keys_of(just, white);
  CHECK(keys[69] == Approx(432.0).epsilon(1e-13));
  CHECK(keys[60] == Approx(432.0 * 3.0 / 5.0).epsilon(1e-13));
  CHECK(keys[61] == 0.0);
  CHECK(keys[72] == Approx(432.0 * 6.0 / 5.0).epsilon(1e-13));
  CHECK(keys[64] == Approx(432.0 * 3.0 / 5.0 * 5.0 / 4.0).epsilon(1e-13));
  CHECK(keys[47] == Approx(432.0 * 3.0 / 5.0 / 2.0 * 15.0 / 16.0).epsilon(1e-13));
  // Keys outside the range are not retuned; keys missing at the end are silent.
  const auto some = keys_of(just, "3\n60\n70\n60\n60\n300\n0\n0\n1\n");
  CHECK(some[59] == Approx(440.0 * std::exp2(-10.0 / 12.0)).epsilon(1e-13));
  CHECK(some[71] == Approx(440.0 * std::exp2(2.0 / 12.0)).epsilon(1e-13));
  CHECK(some[60] == 300.0);
  CHECK(some[61] == Approx(300.0 * 9.0 / 8.0).epsilon(1e-13));
  CHECK(some[62] == 0.0);
  CHECK(some[63] == Approx(600.0).epsilon(1e-13));  // 0: the map repeats by the period
  // A reference key without a step lies halfway between its neighbours, here steps 0 and 7.
  const auto between = keys_of(just, "2\n0\n127\n60\n61\n440\n7\n0\nx\n");
  CHECK(between[60] == Approx(440.0 / std::sqrt(2.0)).epsilon(1e-13));
  CHECK(between[61] == 0.0);
  const auto map = parse_keyboard_map("2\n0\n127\n60\n61\n440\n7\nx\nx\n");
  const auto none = key_frequencies(*parse_scale(just), *map);
  REQUIRE(!none);
  CHECK(none.error().message == "the keyboard map makes all keys silent");
}

// Each way to write a pitch, in each place, with each comment: 240 scales.
TEST_CASE("scales in the style of the archive are read", "[scala]") {
  const struct {
    const char* text;
    double cents;
  } pitches[] = {{"3/2", 701.9550008653874},
                 {"5/4!third", 386.3137138648348},
                 {"386.31! a third", 386.31},
                 {"701.955 cents", 701.955},
                 {"12345678901234567891/9876543210987654321", 386.3136980889643},
                 {"-5.0", -5.0},
                 {"1/1", 0.0},
                 {"2", 1200.0},
                 {"9/10", -182.40371213405998},
                 {"100.", 100.0}};
  const std::string lasts[] = {"2/1", "3/1! tritave", "1200.0", "1/1", "-100.0", "1/2"};
  const double periods[] = {1200.0, 1901.955000865387, 1200.0, 0.0, -100.0, -1200.0};
  int read = 0;
  for (const auto& [text, cents_of_text] : pitches) {
    for (std::size_t last = 0; last < std::size(lasts); ++last) {
      for (const std::string& line : {std::string("\n"), std::string("\r\n")}) {
        for (const std::string& comment : {std::string(), std::string("! @ABL SOURCE x")}) {
          const std::string scale = "! x.scl" + line + "a scale" + line + " 2" + line + "!" + line +
                                    " " + text + line + " " + lasts[last] + line + comment;
          const auto keys = keys_of(scale);
          INFO(scale);
          CHECK(std::fabs(cents(keys[61], keys[60]) - cents_of_text) < 1e-6);
          CHECK(std::fabs(cents(keys[62], keys[60]) - periods[last]) < 1e-9);
          CHECK(keys[60] == Approx(440.0 * std::exp2(-0.75)).epsilon(1e-13));
          ++read;
        }
      }
    }
  }
  CHECK(read == 240);
  // Without notes, a scale has 1/1 only.
  const auto one = keys_of("! none\nno notes\n0\n");
  CHECK(one[20] == one[100]);
}

TEST_CASE("an .ascl file sets the reference pitch", "[scala]") {
  // Step 1 of the octave below middle C, a fifth above its first step, is at 330 Hz.
  const std::string scale = "! x.ascl\nx\n2\n3/2\n2/1\n! @ABL REFERENCE_PITCH 3 1 330.0\n";
  const auto keys = keys_of(scale);
  CHECK(keys[59] == Approx(330.0).epsilon(1e-13));
  CHECK(keys[60] == Approx(440.0).epsilon(1e-13));
  // A keyboard map has its own.
  CHECK(keys_of(scale, "0\n0\n127\n60\n60\n300\n0\n")[60] == Approx(300.0).epsilon(1e-13));
  CHECK(keys_of("x\n1\n2/1\n! see @ABL REFERENCE_PITCH 4 0 100\n")[60] ==
        Approx(440.0 * std::exp2(-0.75)).epsilon(1e-13));
}

TEST_CASE("errors in tunings have a line", "[scala]") {
  CHECK(error_of("").starts_with("1:1: expected a line that describes"));
  CHECK(error_of("x\n").starts_with("2:1: expected how many notes"));
  CHECK(error_of("x\n  y\n").starts_with("2:3: expected how many notes the scale has, 0 to 1024"));
  CHECK(error_of("x\n-1\n").starts_with("2:1:"));
  CHECK(error_of("x\n1025\n").starts_with("2:1:"));
  CHECK(error_of("x\n99999999999\n").starts_with("2:1:"));
  CHECK(error_of("x\n2\n!\n3/2\n").starts_with("5:1: expected note 2 of 2"));
  CHECK(error_of("x\n1\n3/0\n").find("found '3/0'") != std::string::npos);
  for (const char* const wrong :
       {"-3/2", "3/-2", "0", "3//2", "1e400.", "nan.", "3/2/1", "x", "1.2.3"}) {
    CAPTURE(wrong);
    CHECK(error_of("x\n1\n" + std::string(wrong) + "\n").starts_with("3:1: expected note 1 of 1"));
  }
  CHECK(error_of(std::string(70'000, '!')).starts_with("1:1: the scale is longer"));
  const std::string head = "12\n0\n127\n60\n69\n";
  CHECK(error_of("", "-1\n").starts_with("1:1: expected how many keys"));
  CHECK(error_of("", "12\n0\n128\n").starts_with("3:1: expected the last key"));
  CHECK(error_of("", head + "0\n").starts_with("6:1: expected that key's frequency"));
  CHECK(error_of("", head + "440\n12\n0\ny\n").starts_with("9:1: expected the step of key 1"));
  CHECK(error_of("", head).starts_with(
      "6:1: expected that key's frequency, 1 to 20000 Hz, found nothing"));
}

TEST_CASE("random tuning files do not crash the reader", "[scala]") {
  // Valid files with a few characters changed, removed or doubled.
  support::Random random(17);
  const std::string map = "12\n0\n127\n60\n69\n432.0\n7\n0\nx\n1\nx\n2\n3\nx\n4\nx\n5\nx\n6\n";
  constexpr std::string_view letters = "0123456789./-x! \n\r\te";
  int good = 0;
  int bad = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string texts[] = {just, map};
    for (std::string& text : texts) {
      for (std::size_t changes = random.below(3); changes > 0; --changes) {
        text[random.below(text.size())] = letters[random.below(letters.size())];
      }
      if (random.below(8) == 0) {
        text.resize(random.below(text.size()));
      }
    }
    const auto scale = parse_scale(texts[0]);
    const auto keyboard = parse_keyboard_map(texts[1]);
    if (!scale || !keyboard) {
      ++bad;
      REQUIRE((scale || (scale.error().line >= 1 && scale.error().column >= 1)));
      REQUIRE((keyboard || (keyboard.error().line >= 1 && keyboard.error().column >= 1)));
      continue;
    }
    ++good;
    if (const auto keys = key_frequencies(*scale, *keyboard)) {
      for (const double hz : *keys) {
        REQUIRE((hz == 0.0 || (hz >= 1e-3 && hz <= 1e6)));
      }
    }
  }
  CHECK((good > 1000 && bad > 1000));
}

TEST_CASE("keys sound at the pitch of the scale within 0.01 cent", "[scala]") {
  // One mass on a spring, whose frequency in the scheme is 2 - K/M = 2 cos w.
  const std::string one =
      "@m mass 1. 0. 0.\n@g ground 0.\n@r spring @m @g 0.01\n@in1 frcInput @m\n@out1 posOutput "
      "@m\n";
  const auto heard_hz = [&](const Preset& preset, std::vector<Event> events, int key,
                            double guess_hz) {
    Player player(one, preset);
    events.push_back(note_on(0, key));
    player.run(44100, events);
    return measured_hz(player.y(), 44100.0, guess_hz);
  };
  // 19 equal steps: only key 60 has the pitch of equal temperament.
  std::string nineteen = "19\n19\n";
  for (int step = 1; step <= 19; ++step) {
    nineteen += std::to_string(1200.0 * step / 19.0) + "\n";
  }
  Preset preset = struck(1);
  preset.keys_hz = keys_of(nineteen);
  for (const int key : {55, 60, 61, 70, 79}) {
    const double wanted_hz = 440.0 * std::exp2(-9.0 / 12.0 + (key - 60) / 19.0);
    CAPTURE(key);
    CHECK(std::fabs(cents(heard_hz(preset, {}, key, wanted_hz), wanted_hz)) < 0.01);
    CHECK(std::fabs(cents(heard_hz(preset, {}, key, wanted_hz), 1.0001 * wanted_hz)) > 0.01);
  }
  // A reference of 432 Hz shifts all keys, and so does a transposition.
  preset.a4_hz = 432.0;
  preset.transpose = 12;
  const double lower_hz = 432.0 * std::exp2(3.0 / 12.0 + 10.0 / 19.0);
  CHECK(std::fabs(cents(heard_hz(preset, {}, 70, lower_hz), lower_hz)) < 0.01);
  Preset equal = struck(1);
  equal.a4_hz = 442.0;
  CHECK(std::fabs(cents(heard_hz(equal, {}, 69, 442.0), 442.0)) < 0.01);
  // By a tuning message, before and during the note.
  const Event message = {.kind = EventKind::key_tuning, .index = 69, .value = 450.0, .value2 = 1.0};
  CHECK(std::fabs(cents(heard_hz(struck(1), {message}, 69, 450.0), 450.0)) < 0.01);
  Player player(one, struck(1));
  Event later = message;
  later.frame = 1000;
  player.run(50000, {note_on(0, 69), later});
  const std::vector<double> tail(player.y().begin() + 5000, player.y().end());
  CHECK(std::fabs(cents(measured_hz(tail, 44100.0, 450.0), 450.0)) < 0.01);
  // A tuning message for later notes does not change the current one; reset removes it.
  later.value2 = 0.0;
  Player next(one, struck(1));
  next.run(50000, {note_on(0, 69), later});
  const std::vector<double> same(next.y().begin() + 5000, next.y().end());
  CHECK(std::fabs(cents(measured_hz(same, 44100.0, 440.0), 440.0)) < 0.01);
  next.out[0].clear();
  next.run(44100, {note_on(0, 69)});
  CHECK(std::fabs(cents(measured_hz(next.y(), 44100.0, 450.0), 450.0)) < 0.05);
  next.run(100, {{.kind = EventKind::tuning_reset}});
  next.out[0].clear();
  next.run(44100, {note_on(0, 69)});
  CHECK(std::fabs(cents(measured_hz(next.y(), 44100.0, 440.0), 440.0)) < 0.05);
}

TEST_CASE("a key without a pitch is silent", "[scala]") {
  Preset preset = struck(2);
  preset.keys_hz.assign(128, 0.0);
  preset.keys_hz[62] = 300.0;
  Player player(ringing_string(), preset);
  player.run(3000, {note_on(0, 60), note_off(100, 60)});
  CHECK(peak(player.y()) == 0.0);
  player.run(3000, {note_on(0, 62)});
  CHECK(peak(player.y()) > 1e-3);
}

}  // namespace ressort::scala_test
