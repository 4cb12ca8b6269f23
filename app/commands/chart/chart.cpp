#include "app/commands/chart/chart.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "app/commands/chart/judge.h"
#include "app/commands/output.h"
#include "app/commands/progress_bar.h"
#include "app/exit_code.h"
#include "app/realtime/lockfree.h"
#include "app/session/files.h"
#include "app/session/timing.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr std::size_t stretch = 441;  // output samples that are timed at once
constexpr int least_rounds = 3;
constexpr int most_rounds = 100;

Flag interrupted;  // set by Ctrl-C

using ReportProgress = std::function<bool(const std::string&)>;

// Program, date and processor, for the caption of the figures.
std::string provenance() {
  std::string processor = "an unknown processor";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) {
      processor = line.substr(line.find(':') + 2);
      break;
    }
  }
  return made_today() + ", " + processor;
}

// --- playing -------------------------------------------------------------------------------------

// A method and its sound.
struct PlayedWay {
  MadeWay made;
  Waves waves;
};

// Returns whether any output of the published scheme moves.
bool sounds(const ChartScene& scene, Isa isa) {
  auto made = make_way(scene, {.name = "direct", .method = Method::direct}, heard_s, isa);
  if (!made) {
    return true;  // the reference solution will report the reason
  }
  const Waves waves = render_way(*made, static_cast<std::size_t>(heard_s * scene_rate_hz));
  return std::ranges::any_of(waves, [](const std::vector<double>& wave) {
    return std::ranges::any_of(wave, [&](double y) { return y != wave[0]; });
  });
}

// Compares bit by bit, so that NaN equals NaN.
bool is_same(const PlayedWay& a, const PlayedWay& b) {
  return a.made.way.precision == b.made.way.precision && a.made.methods == b.made.methods &&
         std::ranges::equal(a.waves, b.waves, [](const auto& x, const auto& y) {
           return x.size() == y.size() &&
                  std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
         });
}

// Plays all methods that can play the scene. Methods with equal output become one.
std::vector<PlayedWay> play_all(const Starts& starts, Isa isa, const ReportProgress& progress) {
  std::vector<PlayedWay> all;
  for (const Way& way : all_ways()) {
    if (!progress("playing " + way.name + ", " + precision_name(way.precision))) {
      return {};
    }
    auto made = make_way(starts.at(way.oversampling), way, heard_s, isa);
    if (!made) {
      continue;
    }
    PlayedWay played{.made = *std::move(made), .waves = {}};
    played.waves = render_way(played.made, static_cast<std::size_t>(heard_s * scene_rate_hz));
    const auto twin =
        std::ranges::find_if(all, [&](const PlayedWay& other) { return is_same(other, played); });
    if (twin == all.end()) {
      all.push_back(std::move(played));
    } else {
      twin->made.twins.push_back(way.name);
    }
  }
  return all;
}

// --- timing --------------------------------------------------------------------------------------

// Pins this thread to its current core.
void stay_on_one_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(static_cast<std::size_t>(std::max(0, sched_getcpu())), &cores);
  sched_setaffinity(0, sizeof cores, &cores);
}

// Plays every method once and keeps the shortest time of each stretch. Returns the total time.
double time_round(std::vector<MadeWay>& ways, std::vector<std::vector<double>>& shortest_ns,
                  const std::function<bool()>& stops) {
  const double start = thread_cpu_ns();
  for (std::size_t i = 0; i < ways.size() && !stops(); ++i) {
    ways[i].player->rewind();
    for (double& kept : shortest_ns[i]) {
      const double before = thread_cpu_ns();
      ways[i].player->play(stretch * ways[i].way.oversampling, nullptr);
      kept = std::min(kept, thread_cpu_ns() - before);
    }
  }
  return thread_cpu_ns() - start;
}

// Times the methods in turn over the beginning of the scene, as much of it as `patience_s` allows.
// Returns nanoseconds per output sample, [way]; empty if it was stopped.
std::vector<double> time_ways(std::vector<MadeWay>& ways, double patience_s,
                              const std::function<bool()>& stops) {
  constexpr double short_s = 0.03;
  std::vector<std::vector<double>> shortest_ns(ways.size());
  const auto start_over = [&](double seconds) {
    const auto count = static_cast<std::size_t>(seconds * scene_rate_hz) / stretch;
    for (std::vector<double>& one : shortest_ns) {
      one.assign(count, HUGE_VAL);
    }
  };
  start_over(short_s);
  const double short_ns = time_round(ways, shortest_ns, stops);
  start_over(std::clamp(short_s * 1e9 * patience_s / (least_rounds * short_ns), short_s, heard_s));
  double spent_ns = 0.0;
  for (int round = 0;
       !stops() && round < most_rounds && (round < least_rounds || spent_ns < 1e9 * patience_s);
       ++round) {
    spent_ns += time_round(ways, shortest_ns, stops);
  }
  std::vector<double> ns;
  for (const std::vector<double>& one : shortest_ns) {
    const double sum = std::accumulate(one.begin(), one.end(), 0.0);
    ns.push_back(sum / static_cast<double>(one.size() * stretch));
  }
  return stops() ? std::vector<double>() : ns;
}

int write_all(const ChartOptions& options, const std::vector<ChartSheet>& sheets) {
  const std::filesystem::path folder = options.folder;
  const std::string made_by = provenance();
  const bool is_forced = true;
  if (const int code =
          write_output((folder / "chart.csv").string(), chart_csv(sheets, made_by), is_forced)) {
    return code;
  }
  std::printf("%s: %s\n", (folder / "chart.csv").c_str(),
              counted(sheets.size(), "scene", "scenes").c_str());
  if (const auto found = plot::check_gnuplot(); !found) {
    print_error("no figures: " + found.error().message);
    return exit_code::done;
  }
  for (const ChartSheet& sheet : sheets) {
    const std::string path = (folder / (sheet.scene + ".svg")).string();
    if (const int code = put_figure(path, sheet_figure(sheet, made_by), is_forced)) {
      return code;
    }
  }
  const std::string overview = (folder / "overview.svg").string();
  const int code = put_figure(overview, overview_figure(sheets, made_by), is_forced);
  if (code == exit_code::done) {
    std::printf("%s: all scenes; SCENE.svg beside it has one\n", overview.c_str());
  }
  return code;
}

}  // namespace

Result<ChartSheet> make_sheet(const ChartScene& asked, Isa isa, double patience_s,
                              const ReportProgress& progress) {
  const ChartScene scene = sounds(asked, isa) ? asked : struck(asked);
  if (!sounds(scene, isa)) {
    return Error{scene.name + ": no output moves, even when it is struck"};
  }
  ChartSheet sheet{.scene = scene.name, .about = scene.about};
  if (!progress("computing the reference")) {
    return sheet;
  }
  const Starts starts(scene);
  auto references = find_references(scene, starts.at(1), isa);
  if (!references) {
    return Error{scene.name + ": " + references.error().message};
  }
  sheet.reference = references->how;
  sheet.window_s = references->window_s;
  if (!references->is_exact) {
    sheet.floor_db = references->floor_db;
  }
  std::vector<PlayedWay> all = play_all(starts, isa, progress);
  const Stress stress(scene, isa);
  std::vector<MadeWay> ways;
  for (PlayedWay& played : all) {
    const Way& way = played.made.way;
    if (!progress("testing the stability of " + way.name)) {
      return ChartSheet{};
    }
    ChartRow row{.way = way, .methods = played.made.methods, .twins = played.made.twins};
    row.snr_db = references->snr_db(played.waves);
    row.failure = stress.verdict(way);
    ways.push_back(std::move(played.made));
    sheet.rows.push_back(std::move(row));
  }
  if (patience_s > 0.0 && progress("timing " + counted(ways.size(), "method", "methods"))) {
    const std::vector<double> ns = time_ways(ways, patience_s, [&] { return !progress("timing"); });
    for (std::size_t i = 0; i < ns.size(); ++i) {
      sheet.rows[i].ns = ns[i];
    }
  }
  find_fronts(sheet);
  return sheet;
}

int chart(const ChartOptions& options) {
  std::signal(SIGINT, [](int) { interrupted.raise(); });
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error) {
    return reject("cannot create the folder '" + options.folder + "': " + error.message());
  }
  std::vector<ChartScene> scenes;
  for (const std::string& name : options.scenes.empty() ? reference_scenes() : options.scenes) {
    auto scene = chart_scene(name);
    if (!scene) {
      return reject(scene.error().message);
    }
    scenes.push_back(*std::move(scene));
  }
  stay_on_one_core();
  std::vector<ChartSheet> sheets;
  for (std::size_t i = 0; i < scenes.size() && !interrupted.is_raised(); ++i) {
    ProgressBar bar(true);
    auto sheet =
        make_sheet(scenes[i], best_isa(), options.patience_s, [&](const std::string& text) {
          bar.show(static_cast<double>(i) / static_cast<double>(scenes.size()),
                   scenes[i].name + ": " + text);
          return !interrupted.is_raised();
        });
    if (!sheet) {
      return reject(sheet.error().message);
    }
    if (!interrupted.is_raised()) {
      sheets.push_back(*std::move(sheet));
    }
  }
  if (interrupted.is_raised()) {
    print_error("interrupted; the finished scenes are written");
  }
  const int code = sheets.empty() ? exit_code::our_failure : write_all(options, sheets);
  return interrupted.is_raised() ? exit_code::our_failure : code;
}

}  // namespace ressort::commands
