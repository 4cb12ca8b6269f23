#include "app/console.h"

#include <fcntl.h>
#include <histedit.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cwchar>
#include <filesystem>
#include <mutex>
#include <thread>

#include "app/calls.h"
#include "app/files.h"
#include "core/model/expression.h"
#include "core/model/preset.h"

namespace ressort {

struct Desk {
  Process& process;
  Session& session;
  Console::Print print;
  Recorder recorder;
  Keyboard keyboard;
  bool has_quit = false;
};

namespace {

namespace fs = std::filesystem;

using Words = std::span<const std::string>;

// --- text ---------------------------------------------------------------------------------------

std::string fixed(double number, int digits) {
  char text[400];  // the longest double has 309 digits before its point
  const auto end =
      std::to_chars(text, text + sizeof text, number, std::chars_format::fixed, digits).ptr;
  return {text, end};
}

std::string counted(std::size_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

std::string joined(const std::vector<std::string>& words, std::string_view between) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : std::string(between)) + word;
  }
  return text;
}

// Lines of words in aligned columns.
std::string table(const std::vector<std::vector<std::string>>& rows, std::size_t indent = 0) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t c = 0; c < row.size(); ++c) {
      widths[c] = std::max(widths[c], row[c].size());
    }
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line(indent, ' ');
    for (std::size_t c = 0; c < row.size(); ++c) {
      line += row[c] + std::string(widths[c] - row[c].size() + 2, ' ');
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += (text.empty() ? "" : "\n") + line;
  }
  return text;
}

// Where the last word of a line starts, at its end after a blank; and where its comment does.
// Words are divided as by split_words().
struct LineShape {
  std::size_t last_word = 0;
  std::size_t comment = 0;
};

LineShape shape_of(std::string_view line) {
  LineShape shape{line.size(), line.size()};
  std::size_t at = 0;
  while (at < line.size()) {
    const char c = line[at];
    if (c == ' ' || c == '\t' || c == '\r') {
      shape.last_word = line.size();
      ++at;
      continue;
    }
    if (c == '#') {
      shape.comment = at;
      break;
    }
    const bool is_quoted = c == '"';
    shape.last_word = at;
    at = std::min(line.find_first_of(is_quoted ? "\"" : " \t\r", at + (is_quoted ? 1 : 0)),
                  line.size());
    at += is_quoted && at < line.size() ? 1 : 0;
  }
  return shape;
}

// --- playing ------------------------------------------------------------------------------------

std::shared_ptr<const Loaded> loaded(const Desk& desk) {
  auto current = desk.session.current();
  return current->serial != 0 ? current : nullptr;
}

const Error nothing_loaded{
    "no model is loaded yet; 'models' lists what there is, 'load NAME' "
    "loads one"};

// Sends a playing call to the audio thread; all of its events act together.
Result<std::vector<Event>> play(Desk& desk, const Call& call) {
  if (!loaded(desk)) {
    return nothing_loaded;
  }
  auto events = desk.session.events(call);
  if (!events) {
    Error error = events.error();
    if (const std::string address = call.address + ": "; error.message.starts_with(address)) {
      error.message.erase(0, address.size());
    }
    return error;
  }
  std::vector<TimedEvent> timed;
  for (const Event& event : *events) {
    const auto following = static_cast<std::uint16_t>(events->size() - 1 - timed.size());
    timed.push_back({.event = event, .following = following});
  }
  if (!desk.process.from_console.push_all(timed)) {
    return Error{"the audio thread is busy and took nothing; try again"};
  }
  return events;
}

Result<Done> play_words(Desk& desk, std::string address, Words words) {
  Call call{std::move(address), {}};
  for (const std::string& word : words) {
    call.arguments.push_back(to_argument(word));
  }
  if (auto played = play(desk, call); !played) {
    return played.error();
  }
  return Done{};
}

// The number of the input that a gesture goes to: as typed, or the first that knows it.
Result<std::string> input_for(const Desk& desk, bool InputInfo::*knows, const std::string& gesture,
                              const std::string* word) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  if (word != nullptr) {
    double number = 0.0;
    if (!parse_number(*word, number) || number != std::floor(number) || number < 1.0) {
      return Error{"the input must be a whole number from 1, found '" + *word + "'"};
    }
    return print_number(number);
  }
  for (const InputInfo& input : current->instrument.inputs) {
    if (input.*knows) {
      return std::to_string(input.number);
    }
  }
  return Error{current->name + " has no input with a " + gesture +
               "; 'explain' tells what it has, 'noteon 60' plays it"};
}

Result<Done> note_on(Desk& desk, Words words) {
  return play_words(desk, "/note/on", words);
}
Result<Done> note_off(Desk& desk, Words words) {
  return play_words(desk, "/note/off", words);
}
Result<Done> panic(Desk& desk, Words words) {
  return play_words(desk, "/panic", words);
}

Result<Done> pluck(Desk& desk, Words words) {
  const auto input =
      input_for(desk, &InputInfo::can_pluck, "pluck", words.empty() ? nullptr : &words[0]);
  if (!input) {
    return input.error();
  }
  const std::string strength = words.size() > 1 ? words[1] : "0.8";
  return play_words(desk, "/in/" + *input + "/pluck", {&strength, 1});
}

Result<Done> bow(Desk& desk, Words words) {
  const auto input =
      input_for(desk, &InputInfo::can_bow, "bow", words.size() > 2 ? &words[2] : nullptr);
  if (!input) {
    return input.error();
  }
  return play_words(desk, "/in/" + *input + "/bow",
                    words.first(std::min<std::size_t>(2, words.size())));
}

// Semitone by semitone from a C; the upper row of letters has the black keys.
constexpr std::string_view piano = "awsedftgyhujkolp;'";
constexpr std::string_view piano_picture =
    "    w   e       t   y   u       o   p\n"
    "  a   s   d   f   g   h   j   k   l   ;   '\n"
    "  C   D   E   F   G   A   B   C   D   E   F\n"
    "z and x: an octave down and up; q: back to the commands";

Result<Done> keys(Desk& desk, Words) {
  if (!desk.keyboard) {
    return Error{"'keys' needs a terminal to play from; 'noteon 60' plays without one"};
  }
  if (!loaded(desk)) {
    return nothing_loaded;
  }
  desk.print(std::string(piano_picture));
  int octave = 4;
  double sounding = -1.0;  // a key; none below 0
  std::optional<Error> failure;
  const auto send = [&](const char* address, double key) {
    if (auto played = play(desk, {address, {key}}); !played) {
      failure = played.error();
    }
  };
  const auto release = [&] {
    if (sounding >= 0.0) {
      send("/note/off", sounding);
    }
    sounding = -1.0;
  };
  desk.keyboard([&](char typed) {
    constexpr char control_c = 3;
    constexpr char control_d = 4;
    constexpr char escape = 27;
    const char key = static_cast<char>(std::tolower(static_cast<unsigned char>(typed)));
    release();
    if (key == 'q' || key == control_c || key == control_d || key == escape) {
      return false;
    }
    if (key == 'z' || key == 'x') {
      octave = std::clamp(octave + (key == 'x' ? 1 : -1), -1, 8);
      desk.print("a plays key " + std::to_string(12 * (octave + 1)));
    } else if (const auto semitone = piano.find(key); key != 0 && semitone != piano.npos) {
      sounding = 12.0 * (octave + 1) + static_cast<double>(semitone);
      send("/note/on", sounding);
    }
    return !failure;
  });
  release();
  if (failure) {
    return *failure;
  }
  return Done{};
}

// --- models -------------------------------------------------------------------------------------

Result<Done> load(Desk& desk, Words words) {
  const auto result = desk.session.load_and_wait(words[0]);
  if (!result) {
    return Error{"'" + words[0] + "' was not loaded\n" + result.error().message};
  }
  const Loaded& now = **result;
  const Instrument& instrument = now.instrument;
  std::string text = now.name + ": " + counted(instrument.masses, "mass", "masses") + ", " +
                     counted(instrument.links, "link", "links") + ", " +
                     counted(static_cast<std::size_t>(instrument.voices), "voice", "voices") +
                     ", loaded in " + fixed(now.load_ms, 1) + " ms";
  for (const std::string& warning : now.warnings) {
    text += "\n" + warning;
  }
  desk.print(text);
  return Done{};
}

std::string description_of(const std::string& preset_name) {
  const fs::path path =
      fs::path(models_folder()).parent_path() / "presets" / (preset_name + ".toml");
  const auto text = read_text(path.string(), max_preset_bytes);
  if (!text) {
    return "";
  }
  const auto preset = parse_preset(*text);
  return preset ? preset->description : "";
}

Result<Done> models(Desk& desk, Words) {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& name : known_presets()) {
    rows.push_back({name, description_of(name)});
  }
  const std::string bare = joined(known_models(), ", ");
  desk.print(rows.empty() && bare.empty()
                 ? "nothing in '" + models_folder() + "'; 'load FILE.mdl' loads a file of yours"
                 : "Presets\n" + table(rows, 2) + "\nModels as they are written\n  " + bare);
  return Done{};
}

Result<Done> params(Desk& desk, Words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  std::vector<std::vector<std::string>> rows;
  for (const ParameterInfo& info : current->instrument.parameters) {
    rows.push_back({info.name, print_number(desk.session.parameter(info.name).value_or(info.value)),
                    print_number(info.minimum) + " .. " + print_number(info.maximum)});
  }
  desk.print(rows.empty() ? current->name + " has no parameters" : table(rows));
  return Done{};
}

Result<Done> get(Desk& desk, Words words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  std::vector<std::string> found;
  std::vector<std::string> names;
  for (const ParameterInfo& info : current->instrument.parameters) {
    names.push_back(info.name);
    if (fits(words[0], info.name)) {
      const double value = desk.session.parameter(info.name).value_or(info.value);
      found.push_back(info.name + " = " + print_number(value));
    }
  }
  if (found.empty()) {
    return Error{current->name + " has no parameter '" + words[0] + "'; it has " +
                 (names.empty() ? "none" : joined(names, ", "))};
  }
  desk.print(joined(found, "\n"));
  return Done{};
}

Result<Done> set(Desk& desk, Words words) {
  const auto current = loaded(desk);
  const auto events = play(desk, {"/param/" + words[0], {to_argument(words[1])}});
  if (!events) {
    return events.error();
  }
  double wanted = 0.0;
  parse_number(words[1], wanted);
  std::vector<std::string> lines;
  for (const Event& event : *events) {
    // A model that was loaded by another thread meanwhile has other parameters.
    if (event.model != current->serial) {
      continue;
    }
    const ParameterInfo& info = current->instrument.parameters[event.index];
    std::string line = info.name + " = " + print_number(event.value);
    if (event.value != wanted) {
      line += ", the " + std::string(event.value < wanted ? "highest" : "lowest") + " it may be";
    }
    lines.push_back(std::move(line));
  }
  desk.print(joined(lines, "\n"));
  return Done{};
}

// --- looking ------------------------------------------------------------------------------------

std::string peak(double level_db) {
  return std::isfinite(level_db) ? "peak " + fixed(level_db, 1) + " dBFS" : std::string("silence");
}

Result<Done> status(Desk& desk, Words) {
  const Status now = desk.session.status();
  const std::string limiter = now.limited_db > -0.05
                                  ? "limiter idle"
                                  : "limiter down to " + fixed(now.limited_db, 1) + " dB";
  std::vector<std::vector<std::string>> rows = {
      {"model",
       now.model.empty() ? "none" : now.model + ", loaded in " + fixed(now.load_ms, 1) + " ms"},
      {"audio", now.backend.empty() ? "no backend" : now.backend},
      {"rate", print_number(now.rate_hz) + " Hz, " + std::to_string(now.period_frames) +
                   " frames a period"},
      {"cpu", now.cpu < 0.0 ? "not known" : fixed(100.0 * now.cpu, 1) + " % of the time there is"},
      {"voices", std::to_string(now.voices) + " of " + std::to_string(now.max_voices) + ", " +
                     std::to_string(now.stolen) + " stolen"},
      {"output", peak(now.peak_db) + " since the last status, " + limiter},
      {"xruns", std::to_string(now.xruns)},
      {"resets", std::to_string(now.resets) + " voices that became unstable"},
      {"events", std::to_string(now.late) + " late, " + std::to_string(now.dropped) + " dropped, " +
                     std::to_string(now.malformed) + " malformed"},
  };
  if (desk.recorder.is_running()) {
    rows.push_back({"recording", "yes"});
  }
  desk.print(table(rows));
  return Done{};
}

std::string describe(const InputInfo& input) {
  std::vector<std::string> gestures;
  if (input.can_pluck) {
    gestures.emplace_back("pluck");
  }
  if (input.can_bow) {
    gestures.emplace_back("bow");
  }
  return std::string(input.is_force ? "a force on " : "a hand at ") +
         (input.attached_to.empty() ? "nothing" : input.attached_to) +
         (gestures.empty() ? "" : "; knows " + joined(gestures, " and "));
}

Result<Done> explain(Desk& desk, Words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  const Instrument& instrument = current->instrument;
  constexpr double nothing_to_bound = 1e9;
  const double margin = instrument.stiffness_margin;
  std::vector<std::vector<std::string>> rows = {
      {"model", current->model_path},
      {"lowest mode", instrument.mode
                          ? fixed(instrument.mode->frequency_hz, 2) + " Hz as it is written"
                          : "none that keys could tune"},
      {"keys", instrument.is_tuned
                   ? "set the pitch, up to " + fixed(instrument.highest_frequency_hz, 1) +
                         " Hz; higher ones are folded down by octaves"
                   : "all sound as the model is written"},
      {"stability", margin >= nothing_to_bound ? "nothing to bound"
                    : margin >= 1.0
                        ? "proved; every stiffness may grow " + fixed(margin, 2) + " times"
                        : "not proved; the bound is met at " + fixed(std::max(0.0, margin), 2) +
                              " of the stiffness"},
  };
  for (const InputInfo& input : instrument.inputs) {
    rows.push_back({"input " + std::to_string(input.number), describe(input)});
  }
  rows.push_back({"outputs", std::to_string(instrument.outputs)});
  std::string text = current->name;
  text += current->description.empty() ? "\n" : ": " + current->description + "\n";
  desk.print(text + describe(current->plan) + table(rows));
  return Done{};
}

// --- the rest -----------------------------------------------------------------------------------

Result<Done> record(Desk& desk, Words words) {
  if (words[0] == "stop") {
    auto told = desk.recorder.stop();
    if (!told) {
      return told.error();
    }
    desk.print(*told);
    return Done{};
  }
  if (auto started = desk.recorder.start(words[0]); !started) {
    return started.error();
  }
  desk.print("recording to " + words[0] + "; 'rec stop' ends it");
  return Done{};
}

Result<Done> quit(Desk& desk, Words) {
  desk.has_quit = true;
  return Done{};
}

Result<Done> help(Desk& desk, Words words);

constexpr CommandRow command_rows[] = {
    {"Models", "load", "MODEL", "loads a model or a preset",
     "MODEL is the name of a preset or a model that came with the program, or the path of a .mdl\n"
     "or .toml file. What sounds goes on until the new model is ready and then fades into it; if\n"
     "there is an error in the file, it simply goes on.",
     load},
    {"Models", "preset", "PRESET", "the same; Tab offers the presets only",
     "A preset is a model with ranges for its parameters and a plan of what plays it.", load},
    {"Models", "models", "", "lists what came with the program",
     "Presets go first, each with what it is; then the models that they are made of.", models},
    {"Playing", "noteon", "KEY [VELOCITY]", "starts a note; 60 is the middle C",
     "KEY is 0 to 127, VELOCITY is 1 to 127, or 100 if it is left out.", note_on},
    {"Playing", "noteoff", "KEY", "ends a note", "KEY is 0 to 127.", note_off},
    {"Playing", "keys", "", "plays from the computer's keyboard",
     "The letters are laid out as on a piano. A note lasts until the next, or a second.", keys},
    {"Playing", "pluck", "[INPUT] [STRENGTH]", "plucks with the finger at an input",
     "INPUT is its number, or the first that can pluck; STRENGTH is 0 to 1, or 0.8. 'explain'\n"
     "tells which inputs know a pluck.",
     pluck},
    {"Playing", "bow", "SPEED [PRESSURE] [INPUT]", "draws the bow at an input; speed 0 stops",
     "SPEED is -1 to 1, PRESSURE is 0 to 1, or as it was; INPUT is its number, or the first that\n"
     "can bow. 'explain' tells which inputs know a bow.",
     bow},
    {"Playing", "panic", "", "silence at once", "Every voice fades out.", panic},
    {"Parameters", "params", "", "lists the parameters, their values and ranges", "", params},
    {"Parameters", "get", "PARAMETER", "tells a parameter's value",
     "PARAMETER may be a pattern: 'get m_*' tells all that begin so.", get},
    {"Parameters", "set", "PARAMETER VALUE", "turns a parameter; it stays within its range",
     "PARAMETER may be a pattern: 'set *_Z 0.001' sets all that end so.", set},
    {"Looking", "status", "", "tells what sounds, how loud, at what cost",
     "The peak and the limiter's deepest cut are those since the last status.", status},
    {"Looking", "explain", "", "tells how the model is computed and what plays it", "", explain},
    {"Other", "rec", "FILE|stop", "records what is heard to a WAV file, or ends that",
     "The file has 24 bits a sample and the rate of the audio. A file of that name is replaced.",
     record},
    {"Other", "help", "[COMMAND]", "tells more", "", help},
    {"Other", "quit", "", "ends the program", "", quit},
};

Result<const CommandRow*> find_command(std::string_view name) {
  std::vector<std::string> meant;
  const CommandRow* found = nullptr;
  for (const CommandRow& row : command_rows) {
    if (row.name == name) {
      return &row;
    }
    if (row.name.starts_with(name)) {
      meant.emplace_back(row.name);
      found = &row;
    }
  }
  if (meant.size() == 1) {
    return found;
  }
  const std::string typed = "'" + std::string(name) + "'";
  if (meant.size() > 1) {
    return Error{typed + " could be " + joined(meant, " or ")};
  }
  for (const CommandRow& row : command_rows) {
    meant.emplace_back(row.name);
  }
  return Error{"there is no command " + typed + "; there are " + joined(meant, ", ")};
}

std::string usage(const CommandRow& row) {
  return std::string(row.name) + (row.arguments.empty() ? "" : " ") + std::string(row.arguments);
}

// Lines that work when pasted, with what there is.
std::string examples(const Desk& desk) {
  std::vector<std::string> known = known_presets();
  if (known.empty()) {
    known = known_models();
  }
  const auto current = loaded(desk);
  std::vector<std::vector<std::string>> lines;
  if (!known.empty()) {
    lines.push_back({"load " + known.front(), "# or any name that 'models' lists"});
  }
  lines.push_back({"noteon 60 100", "# the middle C, loud"});
  lines.push_back({"noteoff 60"});
  if (current && !current->instrument.parameters.empty()) {
    const ParameterInfo& info = current->instrument.parameters.front();
    lines.push_back({"set " + info.name + " " + print_number(info.value),
                     "# " + print_number(info.minimum) + " to " + print_number(info.maximum)});
  }
  lines.push_back({"rec take.wav", "# what is heard from now on"});
  lines.push_back({"rec stop"});
  return table(lines, 2);
}

Result<Done> help(Desk& desk, Words words) {
  if (!words.empty()) {
    const auto found = find_command(words[0]);
    if (!found) {
      return found.error();
    }
    const CommandRow& row = **found;
    desk.print(usage(row) + "\n  " + std::string(row.does) +
               (row.details.empty() ? "" : "\n\n" + std::string(row.details)));
    return Done{};
  }
  std::size_t width = 0;
  for (const CommandRow& row : command_rows) {
    width = std::max(width, usage(row).size());
  }
  std::string text;
  std::string_view group;
  for (const CommandRow& row : command_rows) {
    if (row.group != group) {
      group = row.group;
      text += std::string(group) + "\n";
    }
    const std::string shown = usage(row);
    text +=
        "  " + shown + std::string(width - shown.size() + 2, ' ') + std::string(row.does) + "\n";
  }
  desk.print(text + "Examples\n" + examples(desk) +
             "\nThe beginning of a command is enough: 'st' is 'status'. 'help load' tells more of "
             "'load'.");
  return Done{};
}

Result<Done> act(Desk& desk, const Command& command) {
  if (command.name.empty()) {
    return Done{};
  }
  const auto row = find_command(command.name);
  if (!row) {
    return row.error();
  }
  return (*row)->act(desk, command.words);
}

// Files with one of the endings whose names go on from `typed`, and folders.
std::vector<std::string> files(const std::string& typed,
                               std::span<const std::string_view> endings) {
  const std::size_t slash = typed.rfind('/');
  const std::string folder = slash == typed.npos ? "" : typed.substr(0, slash + 1);
  const std::string begun = typed.substr(folder.size());
  std::vector<std::string> found;
  std::error_code stop;  // an unreadable folder has nothing to offer
  for (fs::directory_iterator at(folder.empty() ? "." : folder, stop); !stop && at != end(at);
       at.increment(stop)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(begun) || (begun.empty() && name.starts_with('.'))) {
      continue;
    }
    std::error_code unknown;
    if (at->is_directory(unknown)) {
      found.push_back(folder + name + "/");
    } else if (std::find(endings.begin(), endings.end(), at->path().extension().string()) !=
               endings.end()) {
      found.push_back(folder + name);
    }
  }
  return found;
}

}  // namespace

std::span<const CommandRow> commands() {
  return command_rows;
}

Result<Command> parse_command(std::string_view line) {
  std::vector<std::string> words = split_words(line.substr(0, shape_of(line).comment));
  if (words.empty()) {
    return Command{};
  }
  const auto found = find_command(words[0]);
  if (!found) {
    return found.error();
  }
  const CommandRow& row = **found;
  words.erase(words.begin());
  const std::vector<std::string> wanted = split_words(row.arguments);
  const auto needed = static_cast<std::size_t>(
      std::count_if(wanted.begin(), wanted.end(),
                    [](const std::string& word) { return !word.starts_with('['); }));
  if (words.size() < needed || words.size() > wanted.size()) {
    return Error{"the command is '" + usage(row) + "', found " +
                 counted(words.size(), "word", "words") + " after '" + std::string(row.name) + "'" +
                 (words.size() > wanted.size() && needed > 0
                      ? "; a word with blanks in it is written in quotes"
                      : "")};
  }
  return Command{std::string(row.name), std::move(words)};
}

Console::Console(Process& process, Session& session, Print print)
    : desk_(new Desk{process, session, std::move(print), Recorder(process), {}, false}) {}

Console::~Console() = default;

bool Console::run(const Command& command) {
  if (const auto done = act(*desk_, command); !done) {
    desk_->print("error: " + done.error().message);
  }
  return !desk_->has_quit;
}

bool Console::run_line(std::string_view line) {
  const auto command = parse_command(line);
  if (!command) {
    desk_->print("error: " + command.error().message);
    return !desk_->has_quit;
  }
  return run(*command);
}

Result<Done> Console::run_script(const std::string& path) {
  constexpr std::size_t max_bytes = std::size_t{1} << 20;
  const auto text = read_text(path, max_bytes);
  if (!text) {
    return text.error();
  }
  std::string_view rest = *text;
  for (int number = 1; !rest.empty() && !desk_->has_quit; ++number) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    const auto command = parse_command(line);
    const Result<Done> done = command ? act(*desk_, *command) : Result<Done>(command.error());
    if (!done) {
      const std::size_t column = std::min(line.find_first_not_of(" \t"), line.size()) + 1;
      return Error{path + ":" + std::to_string(number) + ":" + std::to_string(column) +
                   ": error: " + done.error().message};
    }
  }
  return Done{};
}

bool Console::has_quit() const {
  return desk_->has_quit;
}

void Console::lend_keyboard(Keyboard keyboard) {
  desk_->keyboard = std::move(keyboard);
}

std::vector<std::string> Console::completions(std::string_view line) const {
  const LineShape shape = shape_of(line);
  if (shape.comment < line.size()) {
    return {};
  }
  const std::vector<std::string> before = split_words(line.substr(0, shape.last_word));
  const std::vector<std::string> last = split_words(line.substr(shape.last_word));
  const std::string typed = last.empty() ? "" : last[0];
  std::string kind = "COMMAND";
  if (!before.empty()) {
    const auto found = find_command(before[0]);
    const std::vector<std::string> wanted =
        found ? split_words((*found)->arguments) : std::vector<std::string>{};
    kind = before.size() <= wanted.size() ? wanted[before.size() - 1] : "";
  }
  constexpr std::string_view scene_endings[] = {".mdl", ".toml"};
  constexpr std::string_view sound_endings[] = {".wav"};
  std::vector<std::string> words;
  const auto add = [&](std::vector<std::string> more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  if (kind.find("COMMAND") != kind.npos) {
    for (const CommandRow& row : command_rows) {
      words.emplace_back(row.name);
    }
  } else if (kind == "PARAMETER") {
    for (const ParameterInfo& info : desk_->session.current()->instrument.parameters) {
      words.push_back(info.name);
    }
  } else if (kind == "MODEL" || kind == "PRESET") {
    add(known_presets());
    add(kind == "MODEL" ? known_models() : std::vector<std::string>{});
    add(files(typed, scene_endings));
  } else if (kind == "FILE|stop") {
    words.emplace_back("stop");
    add(files(typed, sound_endings));
  }
  std::erase_if(words, [&](const std::string& word) { return !word.starts_with(typed); });
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

// --- the terminal -------------------------------------------------------------------------------

namespace {

// The terminal gives every key at once and shows none, while this lives.
class RawMode {
 public:
  RawMode() {
    tcgetattr(STDIN_FILENO, &before_);
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO | ISIG | IEXTEN);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSADRAIN, &raw);
  }
  ~RawMode() { tcsetattr(STDIN_FILENO, TCSADRAIN, &before_); }
  RawMode(const RawMode&) = delete;
  RawMode& operator=(const RawMode&) = delete;

 private:
  termios before_{};
};

// Characters beyond ASCII are understood, by this thread alone: numbers stay free of the locale,
// and so do the other threads.
class Utf8Thread {
 public:
  Utf8Thread()
      : locale_(newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr)), before_(uselocale(locale_)) {}
  ~Utf8Thread() {
    uselocale(before_);
    if (locale_ != nullptr) {
      freelocale(locale_);
    }
  }
  Utf8Thread(const Utf8Thread&) = delete;
  Utf8Thread& operator=(const Utf8Thread&) = delete;

 private:
  locale_t locale_;
  locale_t before_;
};

bool is_inside_character(char byte) {
  return (static_cast<unsigned char>(byte) & 0xC0u) == 0x80u;
}

// What all the words begin with, in whole characters.
std::string common_beginning(const std::vector<std::string>& words) {
  std::size_t length = words[0].size();
  for (const std::string& word : words) {
    const auto differs = std::mismatch(words[0].begin(), words[0].end(), word.begin(), word.end());
    length = std::min(length, static_cast<std::size_t>(differs.first - words[0].begin()));
  }
  while (length > 0 && length < words[0].size() && is_inside_character(words[0][length])) {
    --length;
  }
  return words[0].substr(0, length);
}

std::string in_columns(const std::vector<std::string>& words) {
  winsize size{};
  const bool is_known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  const std::size_t room = is_known ? size.ws_col : 80;
  std::size_t width = 0;
  for (const std::string& word : words) {
    width = std::max(width, word.size() + 2);
  }
  const std::size_t columns = std::max<std::size_t>(1, room / width);
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool is_last = i + 1 == words.size() || (i + 1) % columns == 0;
    text += words[i] + (is_last ? "\n" : std::string(width - words[i].size(), ' '));
  }
  return text;
}

// The file of the typed lines; empty where there is no home for it.
std::string history_path() {
  fs::path folder;
  if (const char* given = std::getenv("XDG_STATE_HOME"); given != nullptr && *given == '/') {
    folder = given;
  } else if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/') {
    folder = fs::path(home) / ".local" / "state";
  } else {
    return "";
  }
  folder /= "ressort";
  std::error_code error;
  fs::create_directories(folder, error);
  return error ? "" : (folder / "history").string();
}

void put(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace

struct Terminal::Input {
  Input(Console& of, std::function<void()> quit) : console(of), on_quit(std::move(quit)) {
    if (pipe2(wake.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
      wake = {-1, -1};
    }
    thread = std::thread([this] { work(); });
  }

  ~Input() {
    {
      const std::lock_guard lock(mutex);
      is_over = true;
    }
    rouse();
    thread.join();
    console.lend_keyboard({});
    close(wake[0]);
    close(wake[1]);
  }

  Console& console;
  std::function<void()> on_quit;
  std::array<int, 2> wake{-1, -1};  // a pipe: what is written to [1] ends a wait
  std::mutex mutex;                 // of the next three
  bool is_over = false;
  bool is_editing = false;     // libedit has the terminal
  std::string unsaid;          // waits for the thread to put it above the line being typed
  EditLine* editor = nullptr;  // [the thread]
  std::thread thread;

  enum class Woken { key, nothing, over };

  void rouse() {
    const char byte = 0;
    // A full pipe wakes as well.
    static_cast<void>(!write(wake[1], &byte, 1));
  }

  void say(const std::string& text) {
    {
      const std::lock_guard lock(mutex);
      if (!is_editing) {
        put(text + "\n");
        return;
      }
      unsaid += text + "\n";
    }
    rouse();
  }

  // Waits for a key, or the end of the input. Negative: as long as it takes.
  Woken wait(int timeout_ms) {
    while (true) {
      {
        const std::lock_guard lock(mutex);
        if (is_over) {
          return Woken::over;
        }
        if (is_editing && !unsaid.empty()) {
          put("\r\x1b[K" + std::exchange(unsaid, {}));
          el_set(editor, EL_REFRESH);
        }
      }
      pollfd both[] = {{STDIN_FILENO, POLLIN, 0}, {wake[0], POLLIN, 0}};
      const int count = poll(both, 2, timeout_ms);
      if (count == 0) {
        return Woken::nothing;
      }
      if (count < 0 && errno != EINTR) {
        return Woken::over;
      }
      if (count > 0 && both[1].revents != 0) {
        char bytes[64];
        static_cast<void>(!read(wake[0], bytes, sizeof bytes));
      } else if (count > 0) {
        return Woken::key;
      }
    }
  }

  void work() {
    if (isatty(STDIN_FILENO) == 0) {
      read_lines();
      return;
    }
    // In the background, touching the terminal would stop the whole program, sound and all.
    if (tcgetpgrp(STDIN_FILENO) != getpgrp()) {
      return;
    }
    const Utf8Thread utf8;
    editor = isatty(STDOUT_FILENO) != 0 ? el_init("ressort", stdin, stdout, stderr) : nullptr;
    if (editor == nullptr) {
      read_lines();
      return;
    }
    console.lend_keyboard([this](const auto& on_key) { read_keys(on_key); });
    edit_lines();
    el_end(editor);
  }

  // False: there will be no more.
  bool run_line(std::string_view line) {
    if (console.run_line(line)) {
      return true;
    }
    on_quit();
    return false;
  }

  void read_lines() {
    constexpr std::size_t max_line = 65536;
    std::string text;
    while (wait(-1) == Woken::key) {
      char bytes[4096];
      const ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
        continue;
      }
      const bool is_end = got <= 0;
      text.append(bytes, static_cast<std::size_t>(is_end ? 0 : got));
      if (text.size() > max_line || (is_end && !text.empty())) {
        text += '\n';
      }
      std::size_t at = 0;
      for (std::size_t end = 0; (end = text.find('\n', at)) != text.npos; at = end + 1) {
        if (!run_line(std::string_view(text).substr(at, end - at))) {
          return;
        }
      }
      if (is_end) {
        return;
      }
      text.erase(0, at);
    }
  }

  void edit_lines() {
    const std::string path = history_path();
    History* const lines = history_init();
    HistEvent event;
    history(lines, &event, H_SETSIZE, 1000);
    history(lines, &event, H_SETUNIQUE, 1);
    if (!path.empty()) {
      history(lines, &event, H_LOAD, path.c_str());
    }
    el_set(editor, EL_CLIENTDATA, this);
    el_set(editor, EL_PROMPT, prompt);
    el_set(editor, EL_EDITOR, "emacs");
    el_set(editor, EL_SIGNAL, 0);
    el_set(editor, EL_GETCFN, next_character);
    el_set(editor, EL_HIST, history, lines);
    // The narrow form of this one would leak its copies.
    el_wset(editor, EL_ADDFN, L"ressort-complete", L"Completes a word", complete);
    el_set(editor, EL_BIND, "^I", "ressort-complete", nullptr);
    el_set(editor, EL_BIND, "^R", "em-inc-search-prev", nullptr);
    bool goes_on = true;
    while (goes_on) {
      el_resize(editor);
      set_editing(true);
      int count = 0;
      const char* const typed = el_gets(editor, &count);
      const std::string line(typed != nullptr ? typed : "",
                             typed != nullptr ? static_cast<std::size_t>(count) : 0);
      set_editing(false);
      if (!line.ends_with('\n')) {
        put(must_end() ? "\n" : "\nThe console is closed, the sound goes on; Ctrl-C ends it.\n");
        break;
      }
      const std::string words = line.substr(0, line.find_last_not_of(" \t\n") + 1);
      if (!words.empty()) {
        history(lines, &event, H_ENTER, words.c_str());
      }
      goes_on = run_line(words);
    }
    if (!path.empty()) {
      history(lines, &event, H_SAVE, path.c_str());
    }
    history_end(lines);
  }

  bool must_end() {
    const std::lock_guard lock(mutex);
    return is_over;
  }

  void set_editing(bool now) {
    const std::lock_guard lock(mutex);
    is_editing = now;
    if (!unsaid.empty()) {
      put(std::exchange(unsaid, {}));
    }
  }

  void read_keys(const std::function<bool(char)>& on_key) {
    using Clock = std::chrono::steady_clock;
    // Sooner than a finger can: the keyboard repeats a key that is held down.
    constexpr std::chrono::milliseconds repetition{60};
    const RawMode raw;
    char last = 0;
    Clock::time_point last_time;
    bool goes_on = true;
    while (goes_on) {
      const Woken woken = wait(1000);
      if (woken == Woken::over) {
        return;
      }
      if (woken == Woken::nothing) {
        goes_on = on_key(0);
        last = 0;
        continue;
      }
      char bytes[64];
      const ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
      if (got <= 0) {
        return;
      }
      constexpr char escape = 27;
      if (got > 1 && bytes[0] == escape) {  // an arrow or a function key
        continue;
      }
      const Clock::time_point now = Clock::now();
      for (ssize_t i = 0; i < got && goes_on; ++i) {
        if (bytes[i] != last || now - last_time > repetition) {
          goes_on = on_key(bytes[i]);
        }
        last = bytes[i];
      }
      last_time = now;
    }
  }

  static char* prompt(EditLine*) {
    static char text[] = "ressort> ";
    return text;
  }

  static Input& of(EditLine* editor) {
    void* input = nullptr;
    el_get(editor, EL_CLIENTDATA, &input);
    return *static_cast<Input*>(input);
  }

  // Reads one character; 0 ends the line and the reading.
  static int next_character(EditLine* editor, wchar_t* character) {
    std::mbstate_t state{};
    while (of(editor).wait(-1) == Woken::key) {
      char byte = 0;
      const ssize_t got = read(STDIN_FILENO, &byte, 1);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
        continue;
      }
      if (got <= 0) {
        return 0;
      }
      const std::size_t used = std::mbrtowc(character, &byte, 1, &state);
      if (used == static_cast<std::size_t>(-1)) {
        state = {};  // no UTF-8; passed over
      } else if (used != static_cast<std::size_t>(-2)) {
        return 1;
      }
    }
    return 0;
  }

  static unsigned char complete(EditLine* editor, int) {
    const LineInfo* const info = el_line(editor);
    const std::string line(info->buffer, info->cursor);
    const std::vector<std::string> words = of(editor).console.completions(line);
    if (words.empty()) {
      return CC_ERROR;
    }
    const std::string typed = line.substr(shape_of(line).last_word);
    std::string text = common_beginning(words);
    const bool is_whole = words.size() == 1 && !text.ends_with('/');
    const bool is_quoted = typed.starts_with('"') || text.find(' ') != text.npos;
    text = (is_quoted ? "\"" : "") + text;
    if (is_whole) {
      text += is_quoted ? "\" " : " ";
    }
    if (text == typed) {
      put("\n" + in_columns(words));
      return CC_REDISPLAY;
    }
    const auto characters = std::count_if(typed.begin(), typed.end(),
                                          [](char byte) { return !is_inside_character(byte); });
    el_deletestr(editor, static_cast<int>(characters));
    el_insertstr(editor, text.c_str());
    return words.size() == 1 ? CC_REFRESH : CC_REFRESH_BEEP;
  }
};

Terminal::Terminal(Console& console, std::function<void()> on_quit)
    : input_(std::make_unique<Input>(console, std::move(on_quit))) {}

Terminal::~Terminal() = default;

void Terminal::say(const std::string& text) {
  input_->say(text);
}

}  // namespace ressort
