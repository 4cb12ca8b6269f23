// The mapping of controllers as a text.
#include "core/model/preset/controllers.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::controllers_test {
namespace {

// Returns a mapping with one row, whose keys begin in line 2.
std::string row(const std::string& keys) {
  return "[[controller]]\n" + keys + "\n";
}

ControllerSetting setting_of(const std::string& keys) {
  const auto read = parse_controllers(row(keys));
  INFO(keys << (read.ok() ? "" : ": " + read.errors[0].message));
  REQUIRE(read.ok());
  REQUIRE(read.rows.size() == 1);
  return read.rows[0];
}

}  // namespace

TEST_CASE("a mapping has the values of its text, and defaults", "[controllers]") {
  CHECK(parse_controllers("").rows.empty());
  CHECK(setting_of("from = \"cc20\"\nto = \"m_K\"") == ControllerSetting{{.number = 20}, "m_K"});
  CHECK(setting_of("from = \"cc31\"\nto = \"cc74\"\nbits = 14\npickup = true\nsend = true\n"
                   "channel = 16") ==
        ControllerSetting{
            {.number = 31, .channel = 15, .has_14_bits = true, .picks_up = true, .sends = true},
            "cc74"});
  CHECK(setting_of("from = \"nrpn 1234\"\nto = \"m_K\"") ==
        ControllerSetting{{.source = ControllerSource::nrpn, .number = 1234, .has_14_bits = true},
                          "m_K"});
  CHECK(
      setting_of("from = \"nrpn 0\"\nto = \"m_K\"\nmode = \"offset\"") ==
      ControllerSetting{{.source = ControllerSource::nrpn, .mode = ControllerMode::offset}, "m_K"});
  CHECK(setting_of("from = \"note 36\"\nto = \"load Gong\"") ==
        ControllerSetting{{.source = ControllerSource::note, .number = 36}, "load Gong"});
}

TEST_CASE("every error of a mapping has its line, column and advice", "[controllers]") {
  struct Case {
    std::string text;
    int line;
    int column;
    std::string message;
  };
  const std::string good = row("from = \"cc20\"\nto = \"m_K\"");
  const Case cases[] = {
      {"[[controler]]\nfrom = \"cc20\"", 1, 1, "a mapping has only tables of the name"},
      {"x = ", 1, 5, "Error while parsing"},
      {row("from = \"cc120\"\nto = \"m_K\""), 2, 8, "'from' must be \"cc0\" to \"cc119\""},
      {row("from = \"nrpn 16384\"\nto = \"m_K\""), 2, 8, "'from' must be"},
      {row("from = 20\nto = \"m_K\""), 2, 8, "'from' must be a text"},
      {row("from = \"cc6\"\nto = \"m_K\""), 2, 8, "'cc6' is a part of RPN and NRPN"},
      {row("to = \"m_K\""), 1, 1, "'from' must be"},
      {row("from = \"cc20\""), 1, 1, "'to' must be the name of a parameter"},
      {row("from = \"cc20\"\nto = \"m_K\"\nfor = 1"), 4, 7, "unknown key 'for' in a controller"},
      {row("from = \"cc20\"\nto = \"m_K\"\nmode = \"relative\""), 4, 8, "'mode' must be absolute"},
      {row("from = \"cc32\"\nto = \"m_K\"\nbits = 14"), 4, 8, "'bits' must be 7, or 14 for cc0"},
      {row("from = \"cc20\"\nto = \"m_K\"\nbits = 14\nmode = \"offset\""), 4, 8,
       "an encoder sends steps of 7 bits"},
      {row("from = \"cc20\"\nto = \"m_K\"\nchannel = 17"), 4, 11,
       "'channel' must lie between 1 and 16"},
      {row("from = \"cc20\"\nto = \"next\"\nsend = true"), 2, 8, "'next' is an action of a button"},
      {row("from = \"note 36\"\nto = \"m_K\"\npickup = true"), 2, 8,
       "'mode', 'pickup' and 'send' have no effect on a note"},
      {good + row("from = \"cc20\"\nto = \"m_Z\"\nchannel = 3"), 5, 8,
       "cc20 on channel 3 is mapped twice"},
      {row("from = \"cc20\"\nto = \"m_K\"\nbits = 14") + row("from = \"cc52\"\nto = \"m_Z\""), 6, 8,
       "cc52 and cc20 are one controller of 14 bits"},
      {row("from = \"cc52\"\nto = \"m_K\"") + row("from = \"cc20\"\nto = \"m_Z\"\nbits = 14"), 5, 8,
       "cc20 and cc52 are one controller of 14 bits"},
  };
  for (const Case& wrong : cases) {
    INFO(wrong.text);
    const auto read = parse_controllers(wrong.text);
    REQUIRE_FALSE(read.ok());
    CHECK(read.errors[0].message.find(wrong.message) == 0);
    CHECK(read.errors[0].line == wrong.line);
    CHECK(read.errors[0].column == wrong.column);
  }
}

TEST_CASE("a learned row takes the place of others, and all comments stay", "[controllers]") {
  const std::string text =
      "# my desk\n\n[[controller]]  # an encoder\nfrom = \"cc20\"\nto = \"m_K\"  # \\ stiff\n\n"
      "# the pad\n[[controller]]\nfrom = \"note 36\"\nto = \"load A#1\"\n";
  const ControllerSetting learned{
      {.source = ControllerSource::nrpn, .number = 300, .channel = 4, .picks_up = true}, "m_K"};
  const auto replaced = edit_controllers(
      text, [&](const auto& row) { return learned.replaces(row); }, learned);
  REQUIRE(replaced);
  CHECK(*replaced ==
        "# my desk\n\n# an encoder\n[[controller]]\nfrom = \"nrpn 300\"\nto = \"m_K\"\n"
        "bits = 7\npickup = true\nchannel = 5\n# \\ stiff\n\n"
        "# the pad\n[[controller]]\nfrom = \"note 36\"\nto = \"load A#1\"\n");
  const auto none = [](const auto&) { return false; };
  const auto same = [](const ControllerSetting& row) {
    return [row](const ControllerSetting& other) { return other == row; };
  };
  // Rows added to any text are read as they were, and go without a trace.
  using enum ControllerMode;
  for (const std::string& before : {std::string(), text, std::string("# no end of the line")}) {
    for (const ControllerInput& input :
         {ControllerInput{.number = 7, .channel = 0, .sends = true},
          ControllerInput{.number = 21, .has_14_bits = true},
          ControllerInput{.source = ControllerSource::nrpn, .number = 16383, .has_14_bits = true},
          ControllerInput{.source = ControllerSource::nrpn, .mode = offset},
          ControllerInput{.number = 22, .mode = twos_complement},
          ControllerInput{.number = 23, .mode = sign_magnitude}}) {
      const ControllerSetting setting{input, "bow \"pressure\""};
      const auto added = edit_controllers(before, none, setting);
      REQUIRE(added);
      const auto read = parse_controllers(*added);
      REQUIRE(read.ok());
      CHECK(read.rows.back() == setting);
      const auto gone = edit_controllers(*added, same(setting), std::nullopt);
      REQUIRE(gone);
      CHECK((*gone == before || *gone == before + "\n"));
    }
  }
  CHECK_FALSE(edit_controllers("controller = [{ from = \"cc20\", to = \"m_K\" }]",
                               same({{.number = 20}, "m_K"}), std::nullopt));
  CHECK_FALSE(edit_controllers("controllers = 1", none, learned));
}

}  // namespace ressort::controllers_test
