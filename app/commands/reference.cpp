#include "app/commands/reference.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "app/commands/body/solid.h"
#include "app/control/registry.h"
#include "app/control/status.h"
#include "app/exit_code.h"
#include "app/realtime/midi_chart.h"
#include "core/model/language/keywords.h"
#include "core/model/preset/controllers.h"
#include "core/model/preset/preset.h"

namespace ressort::commands {
namespace {

using Cells = std::vector<std::string>;

// Formats code in Markdown; empty for an empty text.
std::string code(std::string_view text) {
  return text.empty() ? "" : "`" + std::string(text) + "`";
}

void print_row(const Cells& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) {
    line += ' ';
    for (const char c : cell) {
      line += c == '|' ? "\\|" : std::string(1, c);
    }
    line += " |";
  }
  std::puts(line.c_str());
}

void print_head(const Cells& cells) {
  print_row(cells);
  print_row(Cells(cells.size(), "---"));
}

void print_keywords() {
  print_head({"keyword", "arguments"});
  for (const Keyword& keyword : keywords()) {
    print_row({code(keyword.word), code(keyword.arguments)});
  }
}

void print_keys(std::span<const PresetKey> keys) {
  print_head({"table", "key", "value", "meaning"});
  for (const PresetKey& key : keys) {
    print_row({code(key.table), code(key.key), std::string(key.value), std::string(key.does)});
  }
}

void print_preset_keys() {
  print_keys(preset_keys());
}

void print_controller_keys() {
  print_keys(controller_keys());
}

void print_gestures() {
  print_head({"how", "motion of the input"});
  for (const GestureRow& gesture : gestures) {
    if (!gesture.does.empty()) {
      print_row({code(gesture.name), std::string(gesture.does)});
    }
  }
}

void print_addresses() {
  print_head({"address", "arguments", "effect"});
  for (const Row* const row : addresses()) {
    print_row({code(row->address), code(row->arguments_text()), std::string(row->does)});
  }
}

void print_commands() {
  print_head({"command", "arguments", "effect"});
  for (const Row* const row : command_rows()) {
    print_row({code(row->command), code(row->words), std::string(row->command_does)});
  }
}

// Prints the figures of /status.reply in its order, then those of the console alone.
void print_status() {
  std::vector<const StatusRow*> rows;
  for (const StatusRow& row : status_rows()) {
    rows.push_back(&row);
  }
  std::ranges::stable_sort(rows, {},
                           [](const StatusRow* row) { return static_cast<unsigned>(row->place); });
  print_head({"place", "figure", "unit", "meaning"});
  for (const StatusRow* const row : rows) {
    print_row({row->place == not_in_reply ? "" : std::to_string(row->place + 1), code(row->name),
               std::string(row->unit), std::string(row->does)});
  }
}

void print_midi() {
  print_head({"message", "number", "received", "effect"});
  for (const MidiChartRow& row : midi_chart()) {
    print_row({std::string(row.message), std::string(row.number), row.is_received ? "yes" : "no",
               std::string(row.does)});
  }
}

void print_materials() {
  const std::vector<Cells> rows = material_table();
  print_head(rows.front());
  for (std::size_t i = 1; i < rows.size(); ++i) {
    print_row(rows[i]);
  }
}

constexpr ReferencePart parts[] = {
    {"model", "the keywords of a .mdl file", print_keywords},
    {"preset", "the keys of a preset", print_preset_keys},
    {"controllers", "the keys of a mapping of controllers", print_controller_keys},
    {"gestures", "the gestures of a preset's controls", print_gestures},
    {"midi", "the MIDI implementation chart", print_midi},
    {"osc", "the addresses of OSC and of scores", print_addresses},
    {"console", "the console's commands", print_commands},
    {"status", "the figures of /status.reply and of the console", print_status},
    {"materials", "the materials of solids", print_materials},
};

}  // namespace

std::span<const ReferencePart> reference_parts() {
  return parts;
}

int reference(std::string_view name) {
  const auto* const part = std::ranges::find(parts, name, &ReferencePart::name);
  if (part == std::end(parts)) {
    return exit_code::wrong_use;
  }
  part->print();
  return exit_code::done;
}

}  // namespace ressort::commands
