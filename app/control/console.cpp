#include "app/control/console.h"

#include <algorithm>
#include <filesystem>

#include "app/control/calls.h"
#include "app/control/desk.h"
#include "app/session/files.h"
#include "app/session/sound_file.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/model/preset/preset.h"

namespace ressort {
namespace {

namespace fs = std::filesystem;

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

Result<Done> help(Desk& desk, Words words);

constexpr CommandRow command_rows[] = {
    {"Models", "load", "MODEL [--force]", "loads a model or a preset",
     "MODEL is the name of a preset or a model that came with the program, or the path of a .mdl\n"
     "or .toml file. What sounds goes on until the new model is ready and then fades into it; if\n"
     "there is an error in the file, it simply goes on. A model that is not stable is such an\n"
     "error; --force plays it all the same, fading out what runs away.",
     act::load},
    {"Models", "preset", "PRESET [--force]", "the same; Tab offers the presets only",
     "A preset is a model with ranges for its parameters and a plan of what plays it.", act::load},
    {"Models", "models", "", "lists what came with the program",
     "Presets go first, each with what it is; then the models that they are made of.", act::models},
    {"Playing", "noteon", "KEY [VELOCITY]", "starts a note; 60 is the middle C",
     "KEY is 0 to 127, VELOCITY is 1 to 127, or 100 if it is left out.", act::note_on},
    {"Playing", "noteoff", "KEY", "ends a note", "KEY is 0 to 127.", act::note_off},
    {"Playing", "keys", "", "plays from the computer's keyboard",
     "The letters are laid out as on a piano. A note lasts until the next, or a second.",
     act::keys},
    {"Playing", "pluck", "[INPUT] [STRENGTH]", "plucks with the finger at an input",
     "INPUT is its number, or the first that can pluck; STRENGTH is 0 to 1, or 0.8. 'explain'\n"
     "tells which inputs know a pluck.",
     act::pluck},
    {"Playing", "bow", "SPEED [PRESSURE] [INPUT]", "draws the bow at an input; speed 0 stops",
     "SPEED is -1 to 1, PRESSURE is 0 to 1, or as it was; INPUT is its number, or the first that\n"
     "can bow. 'explain' tells which inputs know a bow.",
     act::bow},
    {"Playing", "panic", "", "silence at once", "Every voice fades out.", act::panic},
    {"Parameters", "params", "", "lists the parameters, their values and ranges", "", act::params},
    {"Parameters", "get", "PARAMETER", "tells a parameter's value",
     "PARAMETER may be a pattern: 'get m_*' tells all that begin so.", act::get},
    {"Parameters", "set", "PARAMETER VALUE", "turns a parameter; it stays within its range",
     "PARAMETER may be a pattern: 'set *_Z 0.001' sets all that end so.", act::set},
    {"Looking", "status", "", "tells what sounds, how loud, at what cost",
     "The peak and the limiter's deepest cut are those since the last status.", act::status},
    {"Looking", "explain", "", "tells how the model is computed and what plays it", "",
     act::explain},
    {"Other", "rec", "FILE|stop [--force]", "records what is heard to a file, or ends that",
     "The file's ending says what it is: .wav, .w64, .flac, .ogg, .aiff, .au or .caf; 24 bits a\n"
     "sample, and the rate of the audio. Over a sound file that is there it is written by --force\n"
     "only.",
     act::record},
    {"Other", "help", "[COMMAND]", "tells more", "", help},
    {"Other", "quit", "", "ends the program", "", act::quit},
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
  std::string typed = "'";  // shown without what could command the terminal
  for (const char c : name.substr(0, 40)) {
    typed += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  typed += name.size() > 40 ? "...'" : "'";
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

Result<Done> carry_out(Desk& desk, const Command& command) {
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
  // What is written as [--WORD] may be left out, but is nothing else.
  bool is_other = false;
  for (std::size_t i = needed; i < std::min(words.size(), wanted.size()); ++i) {
    is_other |= wanted[i].starts_with("[--") && wanted[i] != "[" + words[i] + "]";
  }
  if (words.size() < needed || words.size() > wanted.size() || is_other) {
    return Error{"the command is '" + usage(row) + "', found " +
                 counted(words.size(), "word", "words") + " after '" + std::string(row.name) + "'" +
                 ((words.size() > wanted.size() && needed > 0) || is_other
                      ? "; a word with blanks in it is written in quotes"
                      : "")};
  }
  return Command{std::string(row.name), std::move(words)};
}

Console::Console(Process& process, Session& session, Print print, Print tell)
    : desk_(new Desk{
          process, session, std::move(print), Recorder(process, std::move(tell)), {}, false}) {}

Console::~Console() = default;

bool Console::run(const Command& command) {
  if (const auto done = carry_out(*desk_, command); !done) {
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
    const Result<Done> done = command ? carry_out(*desk_, *command) : Result<Done>(command.error());
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

std::string_view last_word(std::string_view line) {
  return line.substr(shape_of(line).last_word);
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
  std::vector<std::string> words;
  const auto add = [&](std::vector<std::string> more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  if (kind.find("COMMAND") != kind.npos) {
    for (const CommandRow& row : command_rows) {
      words.emplace_back(row.name);
    }
  } else if (kind == "PARAMETER") {
    const auto loaded =
        desk_->session.current();  // kept while the worker puts another in its place
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      words.push_back(info.name);
    }
  } else if (kind == "MODEL" || kind == "PRESET") {
    add(known_presets());
    add(kind == "MODEL" ? known_models() : std::vector<std::string>{});
    add(files(typed, scene_endings));
  } else if (kind == "FILE|stop") {
    words.emplace_back("stop");
    add(files(typed, sound_endings()));
  }
  std::erase_if(words, [&](const std::string& word) { return !word.starts_with(typed); });
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

}  // namespace ressort
