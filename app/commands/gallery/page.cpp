#include "app/commands/gallery/page.h"

#include <algorithm>
#include <cmath>

#include "app/commands/svg.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

// Levels that a spectrogram shows, from white to black.
constexpr double lightest_dbfs = -96.0;
constexpr double darkest_dbfs = -16.0;
constexpr double envelope_floor_dbfs = -72.0;
const char* const key_ink =
    "#c8402f";  // as dark as the middle of the scale, where colours are lost

// A file's name as a link has it.
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

std::string key_name(int key) {
  constexpr const char* names[] = {"C",       "C\u266f", "D",       "D\u266f", "E",       "F",
                                   "F\u266f", "G",       "G\u266f", "A",       "A\u266f", "B"};
  return names[key % 12] + std::to_string(key / 12 - 1);
}

struct Area {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;

  double x_of(double time_s, const Spectrogram& shown) const {
    return x + width * (time_s - shown.from_s) / (shown.to_s - shown.from_s);
  }
  double y_of(double frequency_hz, const Spectrogram& shown) const {
    return y + height * (1.0 - std::log(frequency_hz / shown.lowest_hz) /
                                   std::log(shown.highest_hz / shown.lowest_hz));
  }
};

// The cells, and a mark where each note's fundamental should be, as long as its key is down.
std::string draw_spectrogram(const ShownPreset& preset, const Spectrogram& shown, const Area& area,
                             bool has_names) {
  std::string svg = "<image x=\"" + px(area.x) + "\" y=\"" + px(area.y) + "\" width=\"" +
                    px(area.width) + "\" height=\"" + px(area.height) +
                    "\" preserveAspectRatio=\"none\" href=\"" +
                    to_data_url(shown, lightest_dbfs, darkest_dbfs) + "\"/>\n";
  for (const ShownNote& note : preset.notes) {
    if (note.fundamental_hz < shown.lowest_hz || note.fundamental_hz > shown.highest_hz) {
      continue;
    }
    const double y = area.y_of(note.fundamental_hz, shown);
    const double x = area.x_of(note.note.start_s, shown);
    const double half = has_names ? 4.5 : 3.0;
    svg += "<path d=\"M" + px(x - 1.6 * half) + " " + px(y - half) + "L" + px(x) + " " + px(y) +
           "L" + px(x - 1.6 * half) + " " + px(y + half) + "Z\" fill=\"" + key_ink +
           "\" stroke=\"#fff\" stroke-width=\"0.8\"/>\n";
    if (has_names) {
      svg += "<text x=\"" + px(x + 2.0) + "\" y=\"" + px(y + 14.0) + "\" font-size=\"10\" fill=\"" +
             key_ink + "\" stroke=\"#fff\" stroke-width=\"2.6\" paint-order=\"stroke\">" +
             key_name(note.note.key) + "</text>\n";
    }
  }
  return svg + box(area.x, area.y, area.width, area.height);
}

std::string draw_envelope(const ShownPreset& preset, const Area& area) {
  const auto outline = [&](const std::vector<double>& levels, const char* colour) {
    std::string path = "M" + px(area.x) + " " + px(area.y + area.height);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const double share = std::clamp(levels[i] / envelope_floor_dbfs, 0.0, 1.0);
      path += "L" +
              px(area.x +
                 area.width * (static_cast<double>(i) + 0.5) / static_cast<double>(levels.size())) +
              " " + px(area.y + area.height * share);
    }
    return "<path d=\"" + path + "L" + px(area.x + area.width) + " " + px(area.y + area.height) +
           "Z\" fill=\"" + colour + "\"/>\n";
  };
  std::string svg;
  for (double dbfs = 0.0; dbfs > envelope_floor_dbfs; dbfs -= 24.0) {
    const double y = area.y + area.height * dbfs / envelope_floor_dbfs;
    svg += line(area.x, y, area.x + area.width, y, grid_ink) +
           label(area.x - 5.0, y + 3.5, fixed(dbfs, 0));
  }
  return svg + outline(preset.peaks_dbfs, "#b5b5b5") + outline(preset.levels_dbfs, "#555") +
         box(area.x, area.y, area.width, area.height);
}

std::string draw_scale(const Area& area) {
  std::string svg;
  constexpr int steps = 40;
  for (int i = 0; i < steps; ++i) {
    const double share = (i + 0.5) / steps;
    const std::string grey = std::to_string(static_cast<int>(std::lround(255.0 * share)));
    svg += "<rect x=\"" + px(area.x) + "\" y=\"" + px(area.y + area.height * i / steps) +
           "\" width=\"" + px(area.width) + "\" height=\"" + px(area.height / steps + 0.5) +
           "\" fill=\"rgb(" + grey + "," + grey + "," + grey + ")\"/>\n";
  }
  for (double dbfs = darkest_dbfs; dbfs >= lightest_dbfs; dbfs -= 20.0) {
    const double y = area.y + area.height * (darkest_dbfs - dbfs) / (darkest_dbfs - lightest_dbfs);
    svg += line(area.x + area.width, y, area.x + area.width + 3.0, y, ink) +
           label(area.x + area.width + 5.0, y + 3.5, fixed(dbfs, 0), "start");
  }
  return svg + box(area.x, area.y, area.width, area.height) +
         label(area.x + area.width + 26.0, area.y + area.height + 17.0, "dBFS", "end");
}

// A second, or so many that the labels have room.
double time_step_s(double length_s, double width) {
  for (const double step_s : {1.0, 2.0, 5.0, 10.0, 20.0}) {
    if (width * step_s / length_s >= 45.0) {
      return step_s;
    }
  }
  return 60.0;
}

std::string draw_time_axis(const Spectrogram& shown, const Area& area, const std::string& unit) {
  std::string svg;
  const double step_s = time_step_s(shown.to_s - shown.from_s, area.width);
  const double bottom = area.y + area.height;
  for (double time_s = 0.0; time_s <= shown.to_s; time_s += step_s) {
    const double x = area.x_of(time_s, shown);
    const bool is_last = time_s + step_s > shown.to_s;
    svg += line(x, bottom, x, bottom + 4.0, ink) +
           label(x, bottom + 16.0, fixed(time_s, 0) + (is_last ? unit : ""), "middle");
  }
  return svg;
}

std::string draw_frequency_axis(const Spectrogram& shown, const Area& area,
                                std::initializer_list<double> frequencies_hz) {
  std::string svg;
  for (const double frequency_hz : frequencies_hz) {
    const double y = area.y_of(frequency_hz, shown);
    svg +=
        line(area.x - 4.0, y, area.x, y, ink) + label(area.x - 6.0, y + 3.5, hertz(frequency_hz));
  }
  return svg;
}

std::string draw_preset(const ShownPreset& preset) {
  const Area envelope{48.0, 8.0, 620.0, 74.0};
  const Area cells{48.0, 92.0, 620.0, 270.0};
  const Area scale{684.0, 92.0, 10.0, 270.0};
  return svg_head(730.0, 390.0, 10.5) + draw_envelope(preset, envelope) +
         draw_spectrogram(preset, preset.spectrogram, cells, true) +
         draw_frequency_axis(preset.spectrogram, cells,
                             {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4}) +
         label(40.0, cells.y + cells.height + 16.0, "Hz") +
         label(684.0, envelope.y + 12.0, "dBFS", "start") +
         draw_time_axis(preset.spectrogram, cells, " s") + draw_scale(scale) + "</svg>\n";
}

std::string signed_fixed(double number, int digits) {
  const std::string text = fixed(std::fabs(number), digits);
  const bool is_zero = text.find_first_not_of("0.") == text.npos;
  return (is_zero ? "" : number < 0.0 ? "\u2212" : "+") + text;
}

std::string level_text(double db) {
  return db <= silence_db ? "silent" : fixed(db, 1);
}

std::string or_dash(const std::optional<double>& number, int digits) {
  return number ? fixed(*number, digits) : "\u2013";
}

// A column of the tables: its head, its unit, what it says, and its cell for one preset.
struct FigureColumn {
  const char* head;
  const char* unit;
  const char* says;
  std::string (*cell)(const PresetFigures& figures);
};

constexpr FigureColumn figure_columns[] = {
    {"peak", "dBFS", "of the phrase, before the limiter",
     [](const PresetFigures& f) { return level_text(f.peak_dbfs); }},
    {"loudness", "LUFS", "of the phrase, integrated, by ITU-R BS.1770",
     [](const PresetFigures& f) { return level_text(f.loudness_lufs); }},
    {"attack", "ms", "of the note, until its level is within 6 dB of the highest",
     [](const PresetFigures& f) { return or_dash(f.attack_ms, 0); }},
    {"T60 held", "s", "of the note while its key is down; \u2013: it does not fall by 3 dB",
     [](const PresetFigures& f) { return or_dash(f.held_t60_s, 2); }},
    {"released", "s", "the same once its key is up",
     [](const PresetFigures& f) { return or_dash(f.released_t60_s, 2); }},
    {"DC", "dBFS",
     "mean of the last second of the phrase, under a Hann window, of the worse channel",
     [](const PresetFigures& f) { return level_text(f.dc_dbfs); }},
    {"stereo", "1", "correlation of both channels; 1: they are the same",
     [](const PresetFigures& f) { return f.stereo ? fixed(f.stereo->correlation, 2) : "\u2013"; }},
    {"mono", "dB", "what is lost where both channels become one",
     [](const PresetFigures& f) {
       return f.stereo ? fixed(std::max(0.0, f.stereo->mono_loss_db), 1) : "\u2013";
     }},
    {"pitch", "cents", "of the strongest partial within a semitone of the key, off the key",
     [](const PresetFigures& f) {
       return f.pitch_cents ? signed_fixed(*f.pitch_cents, 2) : "\u2013";
     }},
    {"loudest", "semitones", "of the partial that is loudest in the first second, off the key",
     [](const PresetFigures& f) {
       return f.loudest_cents ? signed_fixed(*f.loudest_cents / 100.0, 2) : "\u2013";
     }},
    {"CPU", "%", "of one core, for one voice",
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
    html += "<th title=\"" + escaped(column.says) + "\">" + column.head + "<small>" + column.unit +
            "</small></th>";
  }
  html += "</tr>\n";
  for (const ShownPreset& preset : presets) {
    html +=
        "<tr><td><a href=\"#" + link_to(preset.name) + "\">" + escaped(preset.name) + "</a></td>";
    for (const FigureColumn& column : figure_columns) {
      html += "<td>" + (preset.failure.empty() ? column.cell(preset.figures) : "") + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string section_of(const ShownPreset& preset) {
  std::string html = "<section id=\"" + escaped(preset.name) + "\">\n<h2>" + escaped(preset.name) +
                     "</h2>\n<p class=\"about\">" + escaped(preset.description) + "</p>\n";
  if (!preset.failure.empty()) {
    return html + "<pre>" + escaped(preset.failure) + "</pre>\n</section>\n";
  }
  html += "<div class=\"both\">\n" + draw_preset(preset) + "<div><table class=\"one\">\n";
  for (const FigureColumn& column : figure_columns) {
    html += std::string("<tr title=\"") + escaped(column.says) + "\"><td>" + column.head +
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
      ", each playing the same phrase. Above: the level of both channels, light the peak, dark the "
      "root mean square. Below: which frequencies sound when, the darker the louder; a triangle "
      "points at the fundamental of each key that is pressed.</p>\n" +
      table_of_all(presets) + "<p class=\"how\">";
  for (const FigureColumn& column : figure_columns) {
    html += "<b>" + std::string(column.head) + "</b>: " + escaped(column.says) + ". ";
  }
  html += "The note: velocity " + std::to_string(note_velocity) + ", held for " + fixed(held_s, 0) +
          " s. All figures but CPU are taken from the WAV files beside this page. Spectrograms: "
          "constant Q, 34 periods under a Hann window.</p>\n";
  for (const ShownPreset& preset : presets) {
    html += section_of(preset);
  }
  return html + "<footer>" + escaped(made) + "</footer>\n</body>\n</html>\n";
}

std::string gallery_picture(const std::vector<ShownPreset>& presets) {
  constexpr std::size_t across = 3;
  constexpr double width = 292.0;
  constexpr double height = 158.0;
  constexpr double left = 26.0;
  std::vector<const ShownPreset*> shown;
  for (const ShownPreset& preset : presets) {
    if (preset.failure.empty()) {
      shown.push_back(&preset);
    }
  }
  const std::size_t down = (shown.size() + across - 1) / across;
  std::string svg =
      svg_head(left + across * width + 4.0, static_cast<double>(down) * height + 8.0, 9.0) +
      "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const std::size_t row = i / across;
    const Area area{left + static_cast<double>(i % across) * width,
                    20.0 + static_cast<double>(row) * height, width - 14.0, height - 40.0};
    const Spectrogram& all = shown[i]->spectrogram;
    const Spectrogram small = made_smaller(all, (all.rows + 1) / 2, all.columns / 2);
    svg += "<text x=\"" + px(area.x) + "\" y=\"" + px(area.y - 6.0) +
           "\" font-size=\"12\" font-weight=\"bold\">" + escaped(shown[i]->name) + "</text>\n" +
           draw_spectrogram(*shown[i], small, area, false) + draw_time_axis(small, area, " s");
    if (i % across == 0) {
      svg += draw_frequency_axis(small, area, {100.0, 1e3, 1e4});
    }
  }
  return svg + "</svg>\n";
}

std::vector<std::vector<std::string>> gallery_table(const std::vector<ShownPreset>& presets) {
  std::vector<std::vector<std::string>> rows = {{"preset"}};
  for (const FigureColumn& column : figure_columns) {
    rows[0].push_back(std::string(column.head) + (column.unit[0] == '1' ? "" : " ") +
                      (column.unit[0] == '1' ? "" : column.unit));
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
