#include "app/commands/gallery/page.h"

#include <algorithm>
#include <cmath>

#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr double level_floor_dbfs = -72.0;
constexpr double level_step_db = 4.0;  // step between two shades of the figure of all presets

// Percent-encodes a file name.
std::string link_to(const std::string& file) {
  std::string link;
  for (const char c : file) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '.' || c == '_';
    constexpr char digits[] = "0123456789ABCDEF";
    const auto byte = static_cast<unsigned char>(c);
    link += is_plain ? std::string(1, c) : std::string{'%', digits[byte >> 4], digits[byte & 15]};
  }
  return link;
}

// The cells as an image, and a dot at the fundamental of each note, where its key goes down.
plot::Panel notes_panel(const ShownPreset& preset, const Spectrogram& shown,
                        std::initializer_list<double> ticks_hz) {
  plot::Panel panel = spectrogram_panel(shown, ticks_hz);
  plot::Series rim{.style = "points pt 7 ps 0.75 lc rgb '#ffffff'"};
  plot::Series dots{.style = "points pt 7 ps 0.5 lc rgb '" + std::string(plot::accent) + "'"};
  for (const ShownNote& note : preset.notes) {
    if (note.fundamental_hz >= shown.lowest_hz && note.fundamental_hz <= shown.highest_hz) {
      dots.data += plot::row({note.note.start_s, std::log2(note.fundamental_hz)});
    }
  }
  rim.data = dots.data;
  if (!dots.data.empty()) {
    panel.series.insert(panel.series.end(), {rim, dots});
  }
  return panel;
}

plot::Panel level_panel(const ShownPreset& preset) {
  const Spectrogram& shown = preset.spectrogram;
  const auto filled = [&](const std::vector<double>& levels, const char* colour,
                          const std::string& title) {
    plot::Series series{
        .style = "filledcurves y1=" + fixed(level_floor_dbfs, 0) + " lc rgb '" + colour + "'",
        .data = {},
        .title = title};
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(levels.size());
      series.data += plot::row({shown.from_s + share * (shown.to_s - shown.from_s),
                                std::clamp(levels[i], level_floor_dbfs, 0.0)});
    }
    return series;
  };
  return {.x = {.from = shown.from_s, .to = shown.to_s},
          .y = {.title = "dBFS",
                .from = level_floor_dbfs,
                .to = 0.0,
                .ticks = {{0.0, "0"}, {-24.0, "-24"}, {-48.0, "-48"}}},
          .series = {filled(preset.peaks_dbfs, "#b5b5b5", "peak"),
                     filled(preset.levels_dbfs, "#555555", "RMS")},
          .height = 150.0};
}

std::string level_text(double db) {
  return db <= silence_db ? "silent" : fixed(db, 1);
}

std::string or_dash(const std::optional<double>& number, int digits) {
  return number ? fixed(*number, digits) : "\u2013";
}

// A column of the tables.
struct FigureColumn {
  const char* head;
  const char* unit;
  const char* meaning;
  std::string (*cell)(const PresetFigures& figures);
};

constexpr FigureColumn figure_columns[] = {
    {"peak", "dBFS", "highest sample of the phrase, before the limiter",
     [](const PresetFigures& f) { return level_text(f.peak_dbfs); }},
    {"loudness", "LUFS", "integrated loudness of the phrase (ITU-R BS.1770)",
     [](const PresetFigures& f) { return level_text(f.loudness_lufs); }},
    {"attack", "ms", "time until the level of the note is within 6 dB of its highest",
     [](const PresetFigures& f) { return or_dash(f.attack_ms, 0); }},
    {"T60 held", "s", "T60 of the note while its key is down; \u2013: it falls by less than 3 dB",
     [](const PresetFigures& f) { return or_dash(f.held_t60_s, 2); }},
    {"released", "s", "T60 of the note after its key is released",
     [](const PresetFigures& f) { return or_dash(f.released_t60_s, 2); }},
    {"CPU", "%", "share of one core for one voice",
     [](const PresetFigures& f) { return fixed(100.0 * f.cpu_share, 2); }},
};

const char* const style = R"(
body { font: 15px/1.5 Helvetica, Arial, sans-serif; color: #222; max-width: 1080px;
       margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: 0; }
h2 { font-size: 1.15em; margin: 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px; }
th, td { padding: 2px 8px; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; }
th small { font-weight: 400; color: #666; display: block; }
.all td:first-child, .all th:first-child, .one td:first-child { text-align: left; }
.scroll { overflow-x: auto; }
section { margin: 2.6em 0; break-inside: avoid; }
.both { display: flex; flex-wrap: wrap; gap: 20px; align-items: flex-start; }
.both svg { max-width: 100%; height: auto; }
audio { width: 250px; height: 32px; display: block; margin-top: 12px; }
p.about { margin: 0 0 .6em; max-width: 62em; }
footer, .how { color: #555; font-size: 13px; }
a { color: inherit; }
)";

std::string table_of_all(const std::vector<ShownPreset>& presets) {
  std::string html = "<div class=\"scroll\"><table class=\"all\">\n<tr><th>preset</th>";
  for (const FigureColumn& column : figure_columns) {
    html += "<th title=\"" + plot::escaped(column.meaning) + "\">" + column.head + "<small>" +
            column.unit + "</small></th>";
  }
  html += "</tr>\n";
  for (const ShownPreset& preset : presets) {
    html += "<tr><td><a href=\"#" + link_to(preset.name) + "\">" + plot::escaped(preset.name) +
            "</a></td>";
    for (const FigureColumn& column : figure_columns) {
      html += "<td>" + (preset.failure.empty() ? column.cell(preset.figures) : "") + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string section_of(const ShownPreset& preset) {
  std::string html = "<section id=\"" + plot::escaped(preset.name) + "\">\n<h2>" +
                     plot::escaped(preset.name) + "</h2>\n<p class=\"about\">" +
                     plot::escaped(preset.description) + "</p>\n";
  if (!preset.failure.empty()) {
    return html + "<pre>" + plot::escaped(preset.failure) + "</pre>\n</section>\n";
  }
  html += "<div class=\"both\">\n" + preset.drawing + "<div><table class=\"one\">\n";
  for (const FigureColumn& column : figure_columns) {
    html += std::string("<tr title=\"") + plot::escaped(column.meaning) + "\"><td>" + column.head +
            "</td><td>" + column.cell(preset.figures) + "</td><td>" + column.unit + "</td></tr>\n";
  }
  html += "</table>\n";
  for (const char* const file : {".wav", "-note.wav"}) {
    html +=
        "<audio controls preload=\"none\" src=\"" + link_to(preset.name + file) + "\"></audio>\n";
  }
  return html + "</div></div></section>\n";
}

}  // namespace

std::string gallery_page(const std::vector<ShownPreset>& presets, const std::string& made) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>ressort: the presets</title>\n<style>" +
      std::string(style) + "</style>\n</head>\n<body>\n<h1>The presets of ressort</h1>\n<p>" +
      counted(presets.size(), "preset", "presets") +
      ", each playing the same phrase. Above: the level of both channels, peak and RMS. Below: the "
      "spectrogram; darker is louder, and a dot marks the fundamental of each key.</p>\n" +
      table_of_all(presets) + "<p class=\"how\">";
  for (const FigureColumn& column : figure_columns) {
    html += "<b>" + std::string(column.head) + "</b>: " + plot::escaped(column.meaning) + ". ";
  }
  html += "The note: velocity " + std::to_string(note_velocity) + ", held for " + fixed(held_s, 0) +
          " s. All figures but CPU are measured from the WAV files beside this page. Spectrograms: "
          "constant Q, 34 periods, Hann window.</p>\n";
  for (const ShownPreset& preset : presets) {
    html += section_of(preset);
  }
  return html + "<footer>" + plot::escaped(made) + "</footer>\n</body>\n</html>\n";
}

plot::Figure preset_figure(const ShownPreset& preset) {
  plot::Panel cells =
      notes_panel(preset, preset.spectrogram, {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4});
  cells.x.title = "s";
  cells.y.title = "Hz";
  cells.scale_title = "dBFS";
  plot::Panel levels = level_panel(preset);
  levels.has_room_for_scale = true;
  return {.panel_width = 760.0, .panel_height = 330.0, .panels = {levels, cells}};
}

plot::Figure gallery_figure(const std::vector<ShownPreset>& presets) {
  plot::Figure figure{.panel_width = 300.0, .panel_height = 165.0, .columns = 3};
  for (const ShownPreset& preset : presets) {
    if (preset.failure.empty()) {
      const Spectrogram& all = preset.spectrogram;
      Spectrogram small = downsampled(all, (all.rows + 1) / 2, all.columns / 2);
      // Few shades of grey keep the images in the figure small.
      for (double& cell : small.dbfs) {
        cell = level_step_db * std::round(cell / level_step_db);
      }
      figure.panels.push_back(notes_panel(preset, small, {100.0, 1e3, 1e4}));
      figure.panels.back().title = preset.name;
    }
  }
  return figure;
}

std::vector<std::vector<std::string>> gallery_table(const std::vector<ShownPreset>& presets) {
  std::vector<std::vector<std::string>> rows = {{"preset"}};
  for (const FigureColumn& column : figure_columns) {
    rows[0].push_back(std::string(column.head) + " " + column.unit);
  }
  for (const ShownPreset& preset : presets) {
    rows.push_back({preset.name});
    for (const FigureColumn& column : figure_columns) {
      rows.back().push_back(preset.failure.empty() ? column.cell(preset.figures) : "failed");
    }
  }
  return rows;
}

}  // namespace ressort::commands
