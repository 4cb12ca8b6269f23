#include "app/commands/chart/table.h"

#include <cmath>
#include <cstdio>

#include "app/text.h"

namespace ressort::commands {
namespace {

std::string number(double value) {
  if (!std::isfinite(value)) {
    return "";
  }
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string quoted(const std::string& text) {
  return text.find_first_of(",\"") == std::string::npos ? text : "\"" + text + "\"";
}

const char* const meaning =
    "# Every way of computing a scene: what it costs beside how right it is.\n"
    "#\n"
    "# Excitation. Linear scenes at rest: x[-1] = x[0] - 0.01 on the first input's mass, as an\n"
    "# initial condition. Others: the gesture that a note of velocity 0.8 is to the preset, at "
    "the\n"
    "# pitch that is written, as a function of seconds, so that it is the same at every rate: a\n"
    "# pluck sweeps at one speed, a bow approaches its speed in 10 ms. A hand starts at time 0.\n"
    "#\n"
    "# References. T1, identical: the published scheme at 44100 Hz in long double. T2, physical: "
    "the\n"
    "# continuous network of the same M, K, Z; exact modes where the scene is linear, else the\n"
    "# published scheme at 64 or 256 times the rate; floor_* says how far that agrees with itself "
    "at\n"
    "# half the rate, and no way can be judged beyond. Where contacts are, waveforms count for 5 "
    "ms.\n"
    "#\n"
    "# ns: of one core, per output sample at 44100 Hz, one voice, the kernels with their hands,\n"
    "# mean over the first timed_s seconds of the sound, of each stretch the fastest of all "
    "rounds;\n"
    "# upper_ns: the upper quartile of the rounds as they were. voices_48k: 1e9 / 48000 / ns, one "
    "after\n"
    "# another; direct and batch, which put voices side by side into lanes, hold more together.\n"
    "# predicted_ns: by the plan's cost model, the same on machines of one instruction set.\n"
    "# snr_T_W: dB of signal over error beside reference T in the first W of the sound, all "
    "outputs\n"
    "# together, from the first sample that can be heard. cents_T, t60_T (%): the largest error of "
    "a\n"
    "# partial within 60 dB of the loudest, from the poles of the scheme in double; empty where\n"
    "# poles say nothing. energy_T: the highest energy in the first 0.25 s in shares of the\n"
    "# reference's; energy: in shares of that at the start, hands at rest; while nothing touches,\n"
    "# where links can let go. Empty where a kernel does not know where its masses are.\n"
    "# failure: what becomes of it when hit ten times harder, or at the ends of the parameters'\n"
    "# ranges. front_T: no way that does not fail is cheaper and better; by SNR in the chart's\n"
    "# window. also: ways that play the same bits in the same form.\n"
    "#\n"
    "# Area: what the ways that do not fail dominate, in decades of time times dB, from the\n"
    "# reference point 1e5 ns and 0 dB, SNR counted up to 200 dB: the sum over the front, by "
    "log10\n"
    "# of ns. predicted_area: with predicted_ns instead of ns, of no timing at all.\n";

std::vector<std::string> cells_of(const ChartSheet& sheet, const ChartRow& row) {
  std::vector<std::string> cells = {sheet.scene,
                                    quoted(row.way.name),
                                    precision_name(row.way.precision),
                                    row.methods,
                                    std::to_string(row.way.oversampling),
                                    quoted(row.way.budget),
                                    number(row.ns),
                                    number(row.upper_ns),
                                    number(1e9 / 48000.0 / row.ns),
                                    number(row.predicted_ns)};
  for (const Against* const against : {&row.judged.identical, &row.judged.physical}) {
    for (const double db : against->snr_db) {
      cells.push_back(number(db));
    }
    for (const double value : {against->cents, against->t60_percent, against->energy}) {
      cells.push_back(number(value));
    }
  }
  cells.push_back(number(row.judged.energy_gain));
  for (const bool is_on : row.is_on_front) {
    cells.push_back(is_on ? "1" : "0");
  }
  cells.push_back(quoted(row.failure));
  cells.push_back(quoted(joined(row.twins, "; ")));
  return cells;
}

}  // namespace

double ChartSheet::snr_db(const ChartRow& row, std::size_t reference) const {
  return (reference == 0 ? row.judged.identical : row.judged.physical).snr_db[window];
}

void find_fronts(ChartSheet& sheet) {
  for (const std::size_t reference : {0u, 1u}) {
    std::vector<Trade> trades;
    std::vector<Trade> predicted;
    for (const ChartRow& row : sheet.rows) {
      const double db = row.failure.empty() ? sheet.snr_db(row, reference) : -HUGE_VAL;
      trades.push_back({row.ns, db});
      predicted.push_back({row.predicted_ns, db});
    }
    const std::vector<bool> is_on = front_of(trades);
    for (std::size_t i = 0; i < sheet.rows.size(); ++i) {
      sheet.rows[i].is_on_front[reference] = is_on[i];
    }
    sheet.area[reference] = hypervolume(trades);
    sheet.predicted_area[reference] = hypervolume(predicted);
  }
}

const std::vector<std::string>& chart_columns() {
  static const std::vector<std::string> columns = {
      "scene",     "way",      "precision",  "methods",      "oversampling", "budget",
      "ns",        "upper_ns", "voices_48k", "predicted_ns", "snr_t1_5ms",   "snr_t1_50ms",
      "snr_t1_1s", "cents_t1", "t60_t1",     "energy_t1",    "snr_t2_5ms",   "snr_t2_50ms",
      "snr_t2_1s", "cents_t2", "t60_t2",     "energy_t2",    "energy",       "front_t1",
      "front_t2",  "failure",  "also"};
  return columns;
}

std::string to_string(const Provenance& provenance) {
  return provenance.program + ", " + provenance.date + ", on " + provenance.processor +
         ", built by " + provenance.compiler;
}

std::string chart_csv(const std::vector<ChartSheet>& sheets, const Provenance& provenance) {
  std::string text = meaning;
  text += "#\n# made by: " + to_string(provenance) + "\n";
  for (const ChartSheet& sheet : sheets) {
    text += "# scene " + sheet.scene + ": " + sheet.about + "; T1 " + sheet.reference[0] + "; T2 " +
            sheet.reference[1];
    if (!sheet.is_linear) {
      text += ", floor_5ms " + number(sheet.floor_db[0]) + " dB, floor_50ms " +
              number(sheet.floor_db[1]) + " dB, floor_1s " + number(sheet.floor_db[2]) + " dB";
    }
    text += "; window " + number(1e3 * chart_windows_s[sheet.window]) + " ms; timed_s " +
            number(sheet.timed_s) + "; area_t1 " + number(sheet.area[0]) + ", area_t2 " +
            number(sheet.area[1]) + "; predicted_area_t1 " + number(sheet.predicted_area[0]) +
            ", predicted_area_t2 " + number(sheet.predicted_area[1]) + "\n";
  }
  text += joined(chart_columns(), ",") + "\n";
  for (const ChartSheet& sheet : sheets) {
    for (const ChartRow& row : sheet.rows) {
      text += joined(cells_of(sheet, row), ",") + "\n";
    }
  }
  return text;
}

}  // namespace ressort::commands
