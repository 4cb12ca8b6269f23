#include "app/control/console.h"

#include <algorithm>
#include <filesystem>

#include "app/control/console_commands.h"
#include "app/session/files.h"
#include "app/session/sound_file.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/model/preset/preset.h"

namespace ressort::control {
namespace {

namespace fs = std::filesystem;

// Positions in a line: start of the last word (the end of the line after a blank) and of the
// comment. Words are divided as in split_words().
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

Result<const Row*> find_command(std::string_view name) {
  std::vector<std::string> meant;
  const Row* found = nullptr;
  for (const Row* const row : command_rows()) {
    if (same_but_case(row->command, name)) {
      return row;
    }
    if (same_but_case(row->command.substr(0, name.size()), name)) {
      meant.emplace_back(row->command);
      found = row;
    }
  }
  if (meant.size() == 1) {
    return found;
  }
  std::string typed = "'";  // The text is printed without control characters.
  for (const char c : name.substr(0, 40)) {
    typed += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  typed += name.size() > 40 ? "...'" : "'";
  if (meant.size() > 1) {
    return Error{typed + " could be " + joined(meant, " or ")};
  }
  for (const Row* const row : command_rows()) {
    meant.emplace_back(row->command);
  }
  return Error{"there is no command " + typed + "; the commands are " + joined(meant, ", ") +
               did_you_mean(name, meant)};
}

std::string usage(const Row& row) {
  return std::string(row.command) + (row.words.empty() ? "" : " ") + row.words;
}

// Returns example lines that work when pasted, made from the installed models and presets.
std::string examples(const ConsoleContext& console) {
  std::vector<std::string> known = known_presets();
  if (known.empty()) {
    known = known_models();
  }
  const auto current = loaded(console);
  std::vector<std::vector<std::string>> lines;
  if (!known.empty()) {
    lines.push_back({"load " + known.front(), "# or any name listed by 'models'"});
  }
  lines.push_back({"noteon 60 100", "# middle C, loud"});
  lines.push_back({"noteoff 60"});
  if (current && !current->instrument.parameters.empty()) {
    const ParameterInfo& info = current->instrument.parameters.front();
    lines.push_back({"set " + info.name + " " + print_number(info.value),
                     "# " + print_number(info.minimum) + " to " + print_number(info.maximum)});
  }
  lines.push_back({"rec take.wav", "# records the output"});
  lines.push_back({"rec stop"});
  return table(lines, 2);
}

Result<Done> carry_out(ConsoleContext& console, const Command& command) {
  if (command.name.empty()) {
    return Done{};
  }
  const auto row = find_command(command.name);
  if (!row) {
    return row.error();
  }
  return run_command(console, **row, command.words);
}

// Returns files with one of the endings whose names start with `typed`, and folders.
std::vector<std::string> files(const std::string& typed,
                               std::span<const std::string_view> endings) {
  const std::size_t slash = typed.rfind('/');
  const std::string folder = slash == typed.npos ? "" : typed.substr(0, slash + 1);
  const std::string begun = typed.substr(folder.size());
  std::vector<std::string> found;
  std::error_code stop;  // An unreadable folder offers nothing.
  for (fs::directory_iterator at(folder.empty() ? "." : folder, stop); !stop && at != end(at);
       at.increment(stop)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(begun) || (begun.empty() && name.starts_with('.'))) {
      continue;
    }
    std::error_code unknown;
    if (at->is_directory(unknown)) {
      found.push_back(folder + name + "/");
    } else if (std::ranges::find(endings, at->path().extension().string()) != endings.end()) {
      found.push_back(folder + name);
    }
  }
  return found;
}

}  // namespace

Result<Done> command::help(ConsoleContext& console, Words words) {
  if (!words.empty()) {
    const auto found = find_command(words[0]);
    if (!found) {
      return found.error();
    }
    const Row& row = **found;
    console.print(usage(row) + "\n  " + std::string(row.command_does) +
                  (row.details.empty() ? "" : "\n\n" + std::string(row.details)));
    return Done{};
  }
  std::size_t width = 0;
  for (const Row* const row : command_rows()) {
    width = std::max(width, usage(*row).size());
  }
  std::string text;
  const Row* before = nullptr;
  for (const Row* const row : command_rows()) {
    if (before == nullptr || row->group != before->group) {
      text += std::string(heading(row->group)) + "\n";
    }
    before = row;
    const std::string shown = usage(*row);
    text += "  " + shown + std::string(width - shown.size() + 2, ' ') +
            std::string(row->command_does) + "\n";
  }
  console.print(text + "Examples\n" + examples(console) +
                "\nCommands can be abbreviated: 'st' is 'status'. 'help load' explains "
                "'load'.");
  return Done{};
}

Result<Command> parse_command(std::string_view line) {
  bool is_open = false;
  std::vector<std::string> words = split_words(line.substr(0, shape_of(line).comment), &is_open);
  if (words.empty()) {
    return Command{};
  }
  if (is_open) {
    return Error{open_quote};
  }
  const auto found = find_command(words[0]);
  if (!found) {
    return found.error();
  }
  const Row& row = **found;
  words.erase(words.begin());
  std::vector<std::string> wanted = split_words(row.words);
  const bool is_repeated = !wanted.empty() && wanted.back() == "...";
  if (is_repeated) {
    wanted.pop_back();
  }
  const auto needed = static_cast<std::size_t>(std::ranges::count_if(
      wanted, [](const std::string& word) { return !word.starts_with('['); }));
  // A word written as [--WORD] may be omitted but not replaced by another word.
  bool is_other = false;
  for (std::size_t i = needed; i < std::min(words.size(), wanted.size()); ++i) {
    is_other |= wanted[i].starts_with("[--") && wanted[i] != "[" + words[i] + "]";
  }
  const bool are_more = !is_repeated && words.size() > wanted.size();
  if (words.size() < needed || are_more || is_other) {
    return Error{
        "the command is '" + usage(row) + "', found " + counted(words.size(), "word", "words") +
        " after '" + std::string(row.command) + "'" +
        ((are_more && needed > 0) || is_other ? "; put a word with blanks in quotes" : "")};
  }
  return Command{std::string(row.command), std::move(words)};
}

Console::Console(Process& process, Session& session, Print print, Print report)
    : context_(new ConsoleContext{process, session, std::move(print),
                                  Recorder(process, std::move(report))}) {}

Console::~Console() = default;

bool Console::run(const Command& command) {
  if (const auto done = carry_out(*context_, command); !done) {
    context_->print("error: " + done.error().message);
  }
  return !context_->has_quit;
}

bool Console::run_line(std::string_view line) {
  const auto command = parse_command(line);
  if (!command) {
    context_->print("error: " + command.error().message);
    return !context_->has_quit;
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
  for (int number = 1; !rest.empty() && !context_->has_quit; ++number) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    const auto command = parse_command(line);
    const Result<Done> done =
        command ? carry_out(*context_, *command) : Result<Done>(command.error());
    if (!done) {
      const std::size_t column = std::min(line.find_first_not_of(" \t"), line.size()) + 1;
      return Error{path + ":" + std::to_string(number) + ":" + std::to_string(column) +
                   ": error: " + done.error().message};
    }
  }
  return Done{};
}

bool Console::has_quit() const {
  return context_->has_quit;
}

void Console::set_keyboard(Keyboard keyboard) {
  context_->keyboard = std::move(keyboard);
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
        found ? split_words((*found)->words) : std::vector<std::string>{};
    kind = before.size() <= wanted.size() ? wanted[before.size() - 1] : "";
  }
  constexpr std::string_view scene_endings[] = {".mdl", ".toml"};
  std::vector<std::string> words;
  const auto add = [&](std::vector<std::string> more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  if (kind.find("COMMAND") != kind.npos) {
    for (const Row* const row : command_rows()) {
      words.emplace_back(row->command);
    }
  } else if (kind.find("PARAMETER") != kind.npos || kind.find("CONTROL") != kind.npos) {
    const auto loaded =
        context_->session.current();  // Keeps the current scene alive while the worker replaces it.
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      if (kind.find("PARAMETER") != kind.npos) {
        words.push_back(info.name);
      }
    }
    for (const KnobInfo& knob : loaded->instrument.knobs) {
      if (kind.find("CONTROL") != kind.npos) {
        words.push_back(knob.word);
      }
    }
  } else if (kind == "MASS") {
    const auto loaded = context_->session.current();
    for (const StruckInfo& info : loaded->instrument.struck) {
      words.push_back(info.moves.empty() ? info.name : info.name + ":2");
    }
  } else if (kind == "FIGURE") {
    for (const TargetFigureRow& figure : target_figure_rows()) {
      words.push_back(short_name(figure.figure));
    }
  } else if (kind == "MODEL" || kind == "PRESET") {
    add(known_presets());
    add(kind == "MODEL" ? known_models() : std::vector<std::string>{});
    add(files(typed, scene_endings));
  } else if (kind.find("TUNING") != kind.npos) {
    constexpr std::string_view tuning_endings[] = {".scl", ".ascl", ".kbm"};
    if (before.size() == 1) {
      words.emplace_back("off");
    }
    add(files(typed, tuning_endings));
  } else if (kind == "FILE|stop") {
    words.emplace_back("stop");
    add(files(typed, sound_endings()));
  }
  std::erase_if(words, [&](const std::string& word) { return !word.starts_with(typed); });
  std::ranges::sort(words);
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

}  // namespace ressort::control
