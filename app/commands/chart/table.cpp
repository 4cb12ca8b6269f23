#include "app/commands/chart/table.h"

#include <algorithm>
#include <cmath>

#include "app/plot/plot.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

std::string cell(double value) {
  return std::isfinite(value) ? plot::number(value) : "";
}

std::string cell(const std::string& text) {
  return text.find_first_of(",\"") == std::string::npos ? text : "\"" + text + "\"";
}

const char* const meaning =
    "# Cost and error of every method of computing a scene.\n"
    "# Excitation: a linear scene at rest starts with x[-1] = x[0] - 0.01 at the mass of its "
    "first\n"
    "# input. Other scenes play the gesture of a note of velocity 0.8.\n"
    "# ns: time per output sample at 44100 Hz on one core, one voice, without the engine around "
    "it.\n"
    "# voices_48k: voices that fill one core at 48 kHz.\n"
    "# snr_published_db: signal to error against the published scheme in long double.\n"
    "# snr_physical_db: the same against the continuous network of the same M, K and Z: exact "
    "modes\n"
    "# of linear scenes, else the published scheme at 64 or 256 times the rate, which agrees with\n"
    "# itself at half of that up to floor_db. Both count the first window_s of the sound.\n"
    "# front: 1 if no stable method is both cheaper and better. failure: why the method is "
    "unstable.\n"
    "# also: methods with the same output.\n"
    "scene,way,precision,methods,oversampling,budget,ns,voices_48k,snr_published_db,"
    "snr_physical_db,front_published,front_physical,failure,also\n";

}  // namespace

std::vector<bool> front_of(std::span<const CostAndAccuracy> points) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (std::isfinite(points[i].ns) && std::isfinite(points[i].snr_db) && points[i].ns > 0.0) {
      order.push_back(i);
    }
  }
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return points[a].ns < points[b].ns ||
           (points[a].ns == points[b].ns && points[a].snr_db > points[b].snr_db);
  });
  std::vector<bool> is_on(points.size(), false);
  double best = -HUGE_VAL;
  for (const std::size_t i : order) {
    is_on[i] = points[i].snr_db > best;
    best = std::max(best, points[i].snr_db);
  }
  return is_on;
}

void find_fronts(ChartSheet& sheet) {
  for (const std::size_t reference : {published, physical}) {
    std::vector<CostAndAccuracy> points;
    for (const ChartRow& row : sheet.rows) {
      points.push_back({row.failure.empty() ? row.ns : HUGE_VAL, row.snr_db[reference]});
    }
    const std::vector<bool> is_on = front_of(points);
    for (std::size_t i = 0; i < is_on.size(); ++i) {
      sheet.rows[i].is_on_front[reference] = is_on[i];
    }
  }
}

std::string chart_csv(const std::vector<ChartSheet>& sheets, const std::string& made_by) {
  std::string text = "# " + made_by + "\n";
  for (const ChartSheet& sheet : sheets) {
    text += "# scene " + sheet.scene + ": " + sheet.about +
            "; physical reference: " + sheet.reference +
            (sheet.floor_db ? ", floor_db " + plot::number(*sheet.floor_db) : "") + "; window_s " +
            plot::number(sheet.window_s) + "\n";
  }
  text += meaning;
  for (const ChartSheet& sheet : sheets) {
    for (const ChartRow& row : sheet.rows) {
      text += joined(
                  std::vector<std::string>{
                      sheet.scene, cell(row.way.name), precision_name(row.way.precision),
                      row.methods, std::to_string(row.way.oversampling), cell(row.way.budget),
                      cell(row.ns), cell(1e9 / 48000.0 / row.ns), cell(row.snr_db[published]),
                      cell(row.snr_db[physical]), row.is_on_front[published] ? "1" : "0",
                      row.is_on_front[physical] ? "1" : "0", cell(row.failure),
                      cell(joined(row.twins, "; "))},
                  ",") +
              "\n";
    }
  }
  return text;
}

}  // namespace ressort::commands
