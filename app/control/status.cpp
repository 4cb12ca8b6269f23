#include "app/control/status.h"

#include <algorithm>
#include <cmath>

#include "app/text.h"
#include "core/format.h"
#include "core/model/language/expression.h"

namespace ressort::control {
namespace {

// Formats a number with three digits.
std::string about(double number) {
  return formatted("%.3g", number);
}

std::string percent(double share, int digits) {
  return fixed(100.0 * share, digits) + " %";
}

// The energy in modes is unknown, as is the loss while an input is driven.
std::string energy_text(const Status& now) {
  if (now.voices == 0) {
    return "none";
  }
  const std::string voices = "; " + std::to_string(now.voices) + " of " +
                             counted(static_cast<std::size_t>(now.max_voices), "voice", "voices");
  if (!now.is_whole) {
    return (now.energy > 0.0 ? about(now.energy) + " plus that of modes" : "unknown for modes") +
           voices;
  }
  const std::string change = now.is_driven     ? "driven from outside"
                             : now.loss == 0.0 ? "neither rising nor falling"
                                               : (now.loss > 0.0 ? "falling by " : "rising by ") +
                                                     about(std::fabs(now.loss)) + " a second";
  return about(now.energy) + ", " + change + voices;
}

std::string tell_modes(const Status& now) {
  return now.modes == 0 ? ""
                        : std::to_string(now.modes_awake) + " of " + std::to_string(now.modes) +
                              " awake, saves " +
                              percent(1.0 - static_cast<double>(now.modes_awake) /
                                                static_cast<double>(now.modes),
                                      0);
}

// Returns a bar from -60 dBFS to full scale, 3 dB per step.
std::string level_meter(double peak_db) {
  constexpr std::size_t steps = 20;
  // Silence is minus infinity.
  const double step = std::clamp(std::ceil((peak_db + 60.0) / 3.0), 0.0, double{steps});
  const auto filled = static_cast<std::size_t>(step);
  return "[" + std::string(filled, '#') + std::string(steps - filled, '-') + "]";
}

// Returns for example "A3 (100)"; middle C is C4.
std::string notes_text(const Status& now) {
  constexpr const char* names[] = {"C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B"};
  std::string text;
  const std::uint64_t places = now.last_notes.size();
  for (std::uint64_t i = now.notes - std::min(now.notes, places); i < now.notes; ++i) {
    const PlayedNote& note = now.last_notes[i % places];
    text += (text.empty() ? "" : ", ") + std::string(names[note.key % 12]) +
            std::to_string(note.key / 12 - 1) + " (" + std::to_string(note.velocity) + ")";
  }
  return text.empty() ? "none yet" : "last " + text;
}

// Rows are in the order of the console's lines. The positions in /status.reply are part of the OSC
// interface and must not change.
constexpr StatusRow status_table[] = {
    {"model", "", "current model or preset", &Status::model, 0, "model",
     [](const Status& now) { return now.model.empty() ? "none" : now.model; }},
    {"load_ms", "ms", "time to read, prove and compile it", &Status::load_ms, 8, "model",
     [](const Status& now) {
       return now.model.empty() ? "" : "loaded in " + fixed(now.load_ms, 1) + " ms";
     }},
    {"backend", "", "audio backend", &Status::backend, 12, "audio",
     [](const Status& now) { return now.backend.empty() ? "no backend" : now.backend; }},
    {"rate", "Hz", "frames per second", &Status::rate_hz, 6, "rate",
     [](const Status& now) { return print_number(now.rate_hz) + " Hz"; }},
    {"period", "frames", "frames per callback", &Status::period_frames, 7, "rate",
     [](const Status& now) { return std::to_string(now.period_frames) + " frames per period"; }},
    {"cpu", "1", "share of the available time, averaged over a second; -1: no audio is running",
     &Status::cpu, 1, "cpu",
     [](const Status& now) {
       return now.cpu < 0.0 ? "no audio is running"
                            : percent(now.cpu, 1) + " of the available time";
     }},
    {"cpu_peak", "1", "maximum of one period since the last status", &Status::cpu_peak, 14, "cpu",
     [](const Status& now) {
       return now.cpu < 0.0
                  ? ""
                  : "at most " + fixed(100.0 * now.cpu_peak, 1) + " since the last status";
     }},
    {"voices", "", "sounding voices", &Status::voices, 2, "voices",
     [](const Status& now) {
       return std::to_string(now.voices) + " of " + std::to_string(now.max_voices);
     }},
    {"max_voices", "", "most voices", &Status::max_voices, 3},
    {"stolen", "", "voices stolen by new notes", &Status::stolen, not_in_reply, "voices",
     [](const Status& now) { return std::to_string(now.stolen) + " stolen"; }},
    {"shed", "", "voices faded out for lack of CPU time", &Status::shed, not_in_reply, "voices",
     [](const Status& now) { return std::to_string(now.shed) + " dropped for lack of time"; }},
    {"notes", "", "notes started, and the latest with their velocities", &Status::notes,
     not_in_reply, "notes", notes_text},
    {"asleep", "1", "share of the computation saved by sleeping voices", &Status::saved,
     not_in_reply, "asleep",
     [](const Status& now) { return percent(now.saved, 0) + " of the cost of all voices"; }},
    {"energy", "mass * (position / sample)^2", "energy of the sounding voices", &Status::energy,
     not_in_reply, "energy", energy_text},
    {"loss", "energy / s", "energy lost per second", &Status::loss},
    {"driven", "", "an input is driven, so the loss is only partly known", &Status::is_driven},
    {"whole", "", "all of the energy is known", &Status::is_whole},
    {"peak_db", "dBFS", "peak since the last status; -999: silence", &Status::peak_db, 9, "output",
     [](const Status& now) {
       return level_meter(now.peak_db) + " " +
              (now.peak_db > -120.0
                   ? "peak " + fixed(std::min(now.peak_db, -0.0) + 0.0, 1) + " dBFS"
                   : "silence") +
              " since the last status";
     }},
    {"limited_db", "dB", "largest gain reduction since the last status", &Status::limited_db,
     not_in_reply, "output",
     [](const Status& now) {
       return now.limited_db > -0.05 ? "limiter idle"
                                     : "limiter down to " + fixed(now.limited_db, 1) + " dB";
     }},
    {"xruns", "", "dropouts counted by the backend", &Status::xruns, 4, "xruns",
     [](const Status& now) {
       return std::to_string(now.xruns) + "; " + counted(now.overruns, "period", "periods") +
              " took too long to compute";
     }},
    {"overruns", "", "periods computed too slowly for real time", &Status::overruns},
    {"resets", "", "voices that became unstable", &Status::resets, 5, "resets",
     [](const Status& now) { return std::to_string(now.resets) + " voices that became unstable"; }},
    {"beyond", "", "times that a parameter was limited for stability", &Status::beyond, 13,
     "limits",
     [](const Status& now) {
       return std::to_string(now.beyond) + " times a parameter was limited for stability";
     }},
    {"late", "", "events that arrived late", &Status::late, 10, "events",
     [](const Status& now) { return std::to_string(now.late) + " late"; }},
    {"dropped", "", "events lost because a queue was full or a period was missed", &Status::dropped,
     11, "events", [](const Status& now) { return std::to_string(now.dropped) + " dropped"; }},
    {"malformed", "", "malformed MIDI messages", &Status::malformed, not_in_reply, "events",
     [](const Status& now) { return std::to_string(now.malformed) + " malformed"; }},
    {"strangers", "", "OSC packets from senders that are not allowed", &Status::strangers,
     not_in_reply, "events",
     [](const Status& now) { return std::to_string(now.strangers) + " ignored"; }},
    {"tempo", "beats / min", "tempo of a MIDI clock or of JACK's transport; 0: none so far",
     &Status::tempo, not_in_reply, "clock",
     [](const Status& now) {
       return now.tempo > 0.0 ? fixed(now.tempo, 1) + " beats per minute" : "none";
     }},
    {"modes", "", "modes of the sounding voices", &Status::modes, not_in_reply, "modes",
     tell_modes},
    {"modes_awake", "", "modes that are awake", &Status::modes_awake},
};

// Null after the last position.
const StatusRow* row_at(int place) {
  const auto* const row = std::ranges::find(status_table, place, &StatusRow::place);
  return row != std::end(status_table) ? row : nullptr;
}

using Figure = std::variant<double, std::uint64_t, std::string>;

Figure figure_of(const StatusRow& row, const Status& status) {
  return std::visit(
      [&](auto figure) {
        if constexpr (std::is_integral_v<std::decay_t<decltype(status.*figure)>>) {
          return Figure(static_cast<std::uint64_t>(status.*figure));
        } else {
          return Figure(status.*figure);
        }
      },
      row.figure);
}

std::string text_of(const StatusRow& row, const Status& status) {
  if (row.text != nullptr) {
    return row.text(status);
  }
  const Figure figure = figure_of(row, status);
  const std::string* const text = std::get_if<std::string>(&figure);
  const double* const real = std::get_if<double>(&figure);
  return (text != nullptr   ? *text
          : real != nullptr ? print_number(*real)
                            : std::to_string(std::get<std::uint64_t>(figure))) +
         (row.unit.empty() ? "" : " ") + std::string(row.unit);
}

}  // namespace

std::span<const StatusRow> status_rows() {
  return status_table;
}

Reply status_reply(const Status& status) {
  Reply reply("/status.reply");
  for (const StatusRow* row = row_at(0); row != nullptr; row = row_at(row->place + 1)) {
    const Figure figure = figure_of(*row, status);
    if (const double* const value = std::get_if<double>(&figure)) {
      row->name == "rate" ? reply.precise(*value) : reply.real(std::max(-999.0, *value));
    } else if (const std::string* const text = std::get_if<std::string>(&figure)) {
      reply.text(*text);
    } else {
      reply.whole(std::get<std::uint64_t>(figure));
    }
  }
  return reply;
}

std::vector<std::vector<std::string>> status_lines(const Status& status) {
  std::vector<std::vector<std::string>> lines;
  for (const StatusRow& row : status_table) {
    const std::string text = row.line.empty() ? "" : text_of(row, status);
    if (text.empty()) {
      continue;
    }
    if (lines.empty() || lines.back()[0] != row.line) {
      lines.push_back({std::string(row.line), text});
    } else {
      lines.back()[1] += ", " + text;
    }
  }
  return lines;
}

}  // namespace ressort::control
