// The console: parsing, completion, and the effect of commands on a process driven by the test.
#include "app/control/console.h"

#include <unistd.h>

#include <chrono>
#include <future>

#include "app/control/registry.h"
#include "app/control/terminal.h"
#include "tests/support/app/console_harness.h"
#include "tests/support/catch.h"

namespace ressort::console_test {
namespace {

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::string error_of(std::string_view line) {
  const auto command = parse_command(line);
  REQUIRE_FALSE(command);
  return command.error().message;
}

}  // namespace

TEST_CASE("commands can be abbreviated to a unique prefix", "[console]") {
  CHECK(parse_command("noteon 60")->name == "noteon");
  CHECK(parse_command("noteon 60")->words == std::vector<std::string>{"60"});
  CHECK(parse_command("st")->name == "status");
  CHECK(parse_command("  he\tlo ")->name == "help");
  CHECK(parse_command("q")->name == "quit");
  for (const Row* const row : command_rows()) {
    const auto help = parse_command("help " + std::string(row->command));
    REQUIRE(help);
    CHECK(help->words == std::vector<std::string>{std::string(row->command)});
  }
}

TEST_CASE("an ambiguous or unknown command lists the alternatives", "[console]") {
  CHECK(error_of("n 60") == "'n' could be next or noteon or noteoff");
  CHECK(has(error_of("s"), "status"));
  const std::string unknown = error_of("jump");
  CHECK(has(unknown, "there is no command 'jump'"));
  for (const Row* const row : command_rows()) {
    CHECK(has(unknown, std::string(row->command)));
  }
}

TEST_CASE("empty lines and comments are commands without a name", "[console]") {
  for (const char* line : {"", "   ", "\t", "\r", "# a comment", "   # load x"}) {
    const auto command = parse_command(line);
    REQUIRE(command);
    CHECK(command->name.empty());
  }
  CHECK(parse_command("noteon 60 # loud")->words == std::vector<std::string>{"60"});
}

TEST_CASE("quotes keep a word with blanks together", "[console]") {
  CHECK(parse_command("load \"my model.mdl\"")->words == std::vector<std::string>{"my model.mdl"});
  CHECK(parse_command("load \"a #1.mdl\" # two")->words == std::vector<std::string>{"a #1.mdl"});
  CHECK(parse_command("load take#1.mdl")->words == std::vector<std::string>{"take#1.mdl"});
  CHECK(has(error_of("load \"open end"), "this quote is not closed"));
}

TEST_CASE("a wrong number of words prints the command's usage", "[console]") {
  CHECK(has(error_of("set m_K"), "set PARAMETER VALUE"));
  CHECK(has(error_of("noteon"), "noteon KEY [VELOCITY]"));
  CHECK(has(error_of("panic now"), "'panic', found 1 word"));
  CHECK(has(error_of("load my model.mdl"), "quotes"));
}

TEST_CASE("unstable models load only with --force, and parameters stay in the stable range",
          "[console]") {
  const Folder folder;
  Harness harness;
  const std::string wild = folder.write(
      "wild.mdl", "@g ground 0.\n@m mass 1. 1. 1.\n@r spring @g @m 5.\n@out1 posOutput @m\n");
  folder.write("stiff.mdl", "@K param 1.\n@o osc 1. K 0. 0. 0.\n@out1 posOutput @o\n");
  const std::string wide = folder.write(
      "wide.toml", "model = \"stiff.mdl\"\n[parameters]\nK = { value = 1, range = [0, 9] }\n");
  // K/M at 48 kHz is (44100/48000)^2 times the written value.
  CHECK(has(harness.say("load " + wide),
            "wide.toml:3:5: warning: 'K' is kept below 4.73876; above it the model is not stable"));
  CHECK(harness.say("set K 2") == "K = 2\n");
  CHECK(harness.say("set K 6") == "K: 6 is beyond the stable range, set to 4.73876\n");
  CHECK(harness.say("set K -1") == "K = 0, the lowest value of its range\n");
  const std::string params = harness.say("params");
  INFO(params);
  CHECK(has(params, "0 .. 4.73876  stable below 4.73876"));
  CHECK(has(harness.say("explain"), "proved; every stiffness may be multiplied by up to 1.00"));
  CHECK(has(harness.say("status"), "limits  0 times"));
  const std::string refused = harness.say("load " + wild);
  CHECK(has(refused, "was not loaded\n" + wild + ":3:1: error: unstable: the stiffness 5 of 'r'"));
  CHECK(has(refused, "below 4.73876, at 48000 Hz; pass --force to play it anyway"));
  CHECK(harness.session.current()->name == "wide");
  CHECK(has(harness.say("load " + wild + " --force"), "warning: unstable: the stiffness 5 of 'r'"));
  CHECK(harness.session.current()->name == "wild");
  CHECK(has(harness.say("explain"), "played with --force"));
  CHECK(has(error_of("load wild --farce"), "load MODEL [--force]"));
}

TEST_CASE("help lists and explains every command", "[console]") {
  Harness harness;
  const std::string all = harness.say("help");
  for (const Row* const row : command_rows()) {
    CHECK(has(all, "  " + std::string(row->command)));
    CHECK(has(all, std::string(row->command_does)));
    const std::string one = harness.say("help " + std::string(row->command));
    CHECK(has(one, std::string(row->command_does)));
    CHECK(has(one, std::string(row->details)));
  }
  CHECK(has(harness.say("help jump"), "error: there is no command 'jump'"));
}

TEST_CASE("the examples of help are commands that work", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  const std::string all = harness.say("help");
  std::string_view rest = std::string_view(all).substr(all.find("Examples\n") + 9);
  int tried = 0;
  while (rest.starts_with("  ")) {
    const std::string line(rest.substr(0, rest.find('\n')));
    rest.remove_prefix(line.size() + 1);
    INFO(line);
    CHECK(parse_command(line));
    if (!has(line, "load ") && !has(line, "rec ")) {  // These need files.
      CHECK_FALSE(has(harness.say(line), "error"));
      ++tried;
    }
  }
  CHECK(tried == 3);
}

TEST_CASE("the last word of a line is completed", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  using Words = std::vector<std::string>;
  CHECK(harness.console.completions("").size() == command_rows().size());
  CHECK(harness.console.completions("note") == Words{"noteoff", "noteon"});
  CHECK(harness.console.completions("help pa") == Words{"panic", "params"});
  CHECK(harness.console.completions("set ") == Words{"m_K", "m_Z"});
  CHECK(harness.console.completions("get m_K") == Words{"m_K"});
  CHECK(harness.console.completions("set m_K ").empty());
  CHECK(harness.console.completions("noteon 6").empty());
  CHECK(harness.console.completions("jump ").empty());
  CHECK(harness.console.completions("set # m").empty());
  CHECK(contains(harness.console.completions("rec "), "stop"));
}

TEST_CASE("files are completed, with folders and blanks", "[console]") {
  const Folder folder;
  write_triangle(folder);
  folder.write("my model.mdl", "");
  folder.write("notes.txt", "");
  folder.write("take.wav", "");
  folder.write(".hidden.mdl", "");
  fs::create_directory(folder.file("more"));
  Harness harness;
  using Words = std::vector<std::string>;
  const std::string here = folder.file("");
  CHECK(harness.console.completions("load " + here) ==
        Words{here + "more/", here + "my model.mdl", here + "tri.toml", here + "triangle.mdl"});
  CHECK(harness.console.completions("load \"" + here + "my m") == Words{here + "my model.mdl"});
  CHECK(harness.console.completions("rec " + here + "t") == Words{here + "take.wav"});
  CHECK(harness.console.completions("load " + here + "none/").empty());
}

TEST_CASE("load prints the model and its warnings", "[console]") {
  const Folder folder;
  Harness harness;
  const std::string told = harness.say("load " + write_triangle(folder));
  CHECK(has(told, "tri: 3 masses, 4 links, 4 voices, loaded in "));
  CHECK(has(told, folder.file("triangle.mdl") + ":10:1: warning: "));
}

TEST_CASE("an error in a file is reported with its position, and the sound continues",
          "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  const std::string bad = folder.write("bad.mdl", "@a mass 1. 0. 0.\n@b springg @a @a 0.1 0.\n");
  const std::string told = harness.say("load " + bad);
  CHECK(has(told, "error: '" + bad + "' was not loaded\n" + bad + ":2:4: error: "));
  CHECK(harness.session.current()->name == "tri");
  CHECK(has(harness.say("load " + folder.file("none.mdl")), "there is no model or preset"));
}

TEST_CASE("set limits a parameter to its range, get prints it", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  CHECK(harness.say("get m_K") == "m_K = 0.1\n");
  CHECK(harness.say("set m_K 0.05") == "m_K = 0.05\n");
  CHECK(harness.process.from_console.size() == 1);
  harness.play();
  CHECK(harness.process.from_console.size() == 0);
  CHECK(harness.say("get m_K") == "m_K = 0.05\n");
  CHECK(harness.say("set m_K 5") == "m_K = 0.2, the highest value of its range\n");
  CHECK(harness.say("set m_K -1") == "m_K = 0.01, the lowest value of its range\n");
  const std::string params = harness.say("params");
  INFO(params);
  CHECK(has(params, "m_K  0.01   0.01 .. 0.2  stable below 1.55485\n"));
  CHECK(harness.say("get m_*") == "m_K = 0.01\nm_Z = 0.001\n");
  CHECK(harness.say("get x") == "error: tri has no parameter 'x'; it has m_K, m_Z\n");
  CHECK(has(harness.say("set x 1"), "m_K, m_Z"));
  CHECK(has(harness.say("set m_K loud"), "error: the value must be a number, found 'loud'"));
}

TEST_CASE("a pattern sets several parameters in one block", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  harness.play();
  harness.say("set m_* 0.002");
  TimedEvent first;
  TimedEvent second;
  REQUIRE(harness.process.from_console.pop(first));
  REQUIRE(harness.process.from_console.pop(second));
  CHECK(first.timing == TimedEvent::When::now);
}

TEST_CASE("noteon sounds and panic silences", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  CHECK(harness.loudest(4) == 0.0);
  CHECK(harness.say("noteon 72 127").empty());
  CHECK(harness.loudest(4) > 0.01);
  CHECK(has(harness.say("status"), "1 of 4"));
  CHECK(harness.say("panic").empty());
  harness.loudest(40);  // The fade and the DC filter.
  CHECK(harness.loudest(4) < 1e-6);
  CHECK(has(harness.say("noteon 128"), "error: the key must lie between 0 and 127"));
}

TEST_CASE("pluck and bow use the first input that accepts them", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + folder.write("pluck.mdl", scenes::plucked_harmonics()));
  CHECK(harness.say("pluck").empty());
  TimedEvent timed;
  REQUIRE(harness.process.from_console.pop(timed));
  CHECK(timed.event.gesture == Gesture::pluck);
  CHECK(timed.event.index == 1);
  CHECK(timed.event.value == 0.8);
  CHECK(harness.say("pluck 1 0.25").empty());
  REQUIRE(harness.process.from_console.pop(timed));
  CHECK(timed.event.value == 0.25);
  CHECK(has(harness.say("pluck 2"), "error: input 2 has no pluck in this preset"));
  CHECK(has(harness.say("pluck 1.5"), "a whole number from 1, found '1.5'"));
  CHECK(has(harness.say("bow 0.5"), "error: pluck has no input with a bow"));

  harness.say("load " + folder.write("bowed.mdl", scenes::bowed_string()));
  CHECK(harness.say("bow -0.5").empty());
  REQUIRE(harness.process.from_console.pop(timed));
  CHECK(timed.event.gesture == Gesture::bow);
  CHECK(timed.event.value == -0.5);
  CHECK(timed.event.value2 == -1.0);  // The pressure stays unchanged.
  CHECK(harness.say("bow 1 0.25 1").empty());
  REQUIRE(harness.process.from_console.pop(timed));
  CHECK(timed.event.value2 == 0.25);
}

TEST_CASE("a full queue is reported without waiting", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  bool was_told = false;
  for (std::size_t i = 0; i <= Process::max_now && !was_told; ++i) {
    was_told = has(harness.say("noteon 60"), "busy");
  }
  CHECK(was_told);
  harness.play();
  CHECK(harness.say("noteon 60").empty());
}

TEST_CASE("without a model the commands explain how to load one", "[console]") {
  Harness harness;
  for (const char* line :
       {"noteon 60", "pluck", "bow 1", "params", "get x", "set x 1", "explain"}) {
    INFO(line);
    CHECK(has(harness.say(line), "error: no model is loaded yet"));
  }
  CHECK(has(harness.say("status"), "model   none"));
}

TEST_CASE("explain prints the plan and the controls", "[console]") {
  const Folder folder;
  Harness harness;
  harness.say("load " + write_triangle(folder));
  const std::string told = harness.say("explain");
  CHECK(has(told, "tri: three masses, struck\n"));
  CHECK(has(told, describe(harness.session.current()->plan)));
  CHECK(has(told, "input 1     a force on m_m1\n"));
  CHECK(has(told, "outputs     1\n"));
}

TEST_CASE("a script runs line by line and stops at the first error", "[console]") {
  const Folder folder;
  Harness harness;
  const std::string preset = write_triangle(folder);
  const std::string good =
      folder.write("good", "# a start\nload \"" + preset + "\"\n\nset m_K 0.05\nget m_K");
  CHECK(harness.console.run_script(good));
  CHECK(has(harness.said, "m_K = 0.05\nm_K = 0.05\n"));

  const std::string bad = folder.write("bad", "get m_K\n  jump\nset m_K 0.1\n");
  const auto failed = harness.console.run_script(bad);
  REQUIRE_FALSE(failed);
  CHECK(has(failed.error().message, bad + ":2:3: error: there is no command 'jump'"));
  CHECK(harness.session.parameter("m_K") == 0.05);
  CHECK_FALSE(harness.console.run_script(folder.file("none")));

  CHECK_FALSE(harness.console.has_quit());
  CHECK(harness.console.run_script(folder.write("end", "quit\nset m_K 0.1\n")));
  CHECK(harness.console.has_quit());
  CHECK(harness.session.parameter("m_K") == 0.05);
}

TEST_CASE("only quit ends the console", "[console]") {
  Harness harness;
  CHECK(harness.console.run_line("status"));
  CHECK(harness.console.run_line("jump"));
  CHECK_FALSE(harness.console.run_line("quit"));
}

TEST_CASE("the letter keys play notes", "[console]") {
  const Folder folder;
  Harness harness;
  CHECK(has(harness.say("keys"), "needs a terminal"));
  harness.say("load " + write_triangle(folder));
  std::string typed = "awzsxKq";
  typed.insert(2, 1, '\0');  // A second without a key.
  std::size_t given = 0;
  harness.console.set_keyboard([&](const auto& on_key) {
    while (given < typed.size() && on_key(typed[given++])) {
    }
  });
  CHECK(has(harness.say("keys"), "q: back to the commands"));
  CHECK(given == typed.size());
  std::vector<int> played;  // Below 0: note off.
  TimedEvent timed;
  while (harness.process.from_console.pop(timed)) {
    const int key = timed.event.index;
    played.push_back(timed.event.kind == EventKind::note_on ? key : -key);
  }
  CHECK(played == std::vector<int>{60, -60, 61, -61, 50, -50, 72, -72});
}

namespace {

// Replaces the standard input during its lifetime.
class TypedInput {
 public:
  TypedInput() : before_(dup(STDIN_FILENO)) {
    int both[2];
    REQUIRE(pipe(both) == 0);
    dup2(both[0], STDIN_FILENO);
    close(both[0]);
    write_ = both[1];
  }
  ~TypedInput() {
    end();
    dup2(before_, STDIN_FILENO);
    close(before_);
  }
  TypedInput(const TypedInput&) = delete;
  TypedInput& operator=(const TypedInput&) = delete;

  void type(const std::string& text) {
    REQUIRE(write(write_, text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  }
  void end() {
    if (write_ >= 0) {
      close(write_);
    }
    write_ = -1;
  }

 private:
  int before_;
  int write_;
};

constexpr std::chrono::seconds patience{30};

}  // namespace

TEST_CASE("without a terminal, lines are read until quit", "[console]") {
  Harness harness;
  TypedInput input;
  std::promise<void> promise;
  {
    Terminal terminal(harness.console, [&] { promise.set_value(); });
    input.type("sta");
    input.type("tus\n\nnoteon 60\nquit\nstatus\n");
    REQUIRE(promise.get_future().wait_for(patience) == std::future_status::ready);
  }
  CHECK(has(harness.said, "model   none"));
  CHECK(has(harness.said, "no model is loaded yet"));
  CHECK(harness.said.find("model   none") ==
        harness.said.rfind("model   none"));  // The console executes no command after quit.
}

TEST_CASE("the end of the input ends only the console", "[console]") {
  Harness harness;
  TypedInput input;
  bool has_quit = false;
  std::promise<void> promise;
  Console console(harness.process, harness.session,
                  [&](const std::string&) { promise.set_value(); }, {});
  {
    Terminal terminal(console, [&] { has_quit = true; });
    input.type("status");  // Input without a line end.
    input.end();
    REQUIRE(promise.get_future().wait_for(patience) == std::future_status::ready);
  }
  CHECK_FALSE(has_quit);
}

TEST_CASE("a terminal that waits for a line is interrupted", "[console]") {
  Harness harness;
  TypedInput input;
  bool has_quit = false;
  {
    const Terminal terminal(harness.console, [&] { has_quit = true; });
    input.type("half a line");
  }
  CHECK_FALSE(has_quit);
  CHECK(harness.said.empty());
}

}  // namespace ressort::console_test
