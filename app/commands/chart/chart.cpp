#include "app/commands/chart/chart.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "app/commands/chart/picture/picture.h"
#include "app/commands/chart/start.h"
#include "app/exit_code.h"
#include "app/realtime/lockfree.h"
#include "app/session/files.h"
#include "app/text.h"
#include "app/version.h"

namespace ressort::commands {
namespace {

Flag interrupted;  // by Ctrl-C

using Tells = std::function<bool(const std::string&)>;

void complain(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) {
      return line.substr(line.find(':') + 2);
    }
  }
  return "a processor without a name";
}

Provenance provenance() {
  const std::time_t now = std::time(nullptr);
  char date[16] = "";
  std::tm local{};
  if (localtime_r(&now, &local) != nullptr) {
    std::strftime(date, sizeof date, "%Y-%m-%d", &local);
  }
#ifdef __clang__
  const std::string compiler = std::string("clang ") + __clang_version__;
#else
  const std::string compiler = std::string("g++ ") + __VERSION__;
#endif
  return {.processor = processor(),
          .compiler = compiler,
          .date = date,
          .program = std::string("ressort ") + version + " (" + commit + ")"};
}

// A way and what it plays.
struct Heard {
  MadeWay made;
  Waves waves;
};

// Does any output move, as the published scheme has it?
bool sounds(const ChartScene& scene, Isa isa) {
  auto made = make_way(scene, {.name = "direct", .method = Method::direct}, heard_s, isa);
  if (!made) {
    return true;  // the one to say why is whoever plays it
  }
  const Waves waves = render_way(*made, static_cast<std::size_t>(heard_s * 44100.0));
  return std::any_of(waves.begin(), waves.end(), [](const std::vector<double>& wave) {
    return std::any_of(wave.begin(), wave.end(), [&](double y) { return y != wave[0]; });
  });
}

// Bit by bit: what is no number is the same too.
bool is_same(const Waves& a, const Waves& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
    return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
  });
}

bool is_same(const Heard& a, const Heard& b) {
  return a.made.way.precision == b.made.way.precision &&
         same_kind(a.made.machine(), b.made.machine()) && is_same(a.waves, b.waves);
}

// All ways that can, and each kind of bits only once.
std::vector<Heard> hear_all(const Starts& starts, Isa isa, const Tells& tells) {
  std::vector<Heard> all;
  for (const Way& way : all_ways()) {
    if (!tells(way.name + ", " + precision_name(way.precision))) {
      return {};
    }
    auto made = make_way(starts.at(way.oversampling), way, heard_s, isa);
    if (!made) {
      continue;
    }
    Heard heard{.made = *std::move(made), .waves = {}};
    heard.waves = render_way(heard.made, static_cast<std::size_t>(heard_s * 44100.0));
    const auto twin = std::find_if(all.begin(), all.end(),
                                   [&](const Heard& other) { return is_same(other, heard); });
    if (twin == all.end()) {
      all.push_back(std::move(heard));
    } else {
      twin->made.twins.push_back(way.name);
    }
  }
  return all;
}

// Runs gnuplot over the script in its folder; false where there is none.
bool draw(const std::string& folder) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder);
  FILE* const gnuplot = popen("gnuplot chart.gp", "r");
  const bool is_drawn = gnuplot != nullptr && pclose(gnuplot) == 0;
  std::filesystem::current_path(before);
  return is_drawn;
}

bool has_gnuplot() {
  FILE* const gnuplot = popen("gnuplot --version 2>/dev/null", "r");
  if (gnuplot == nullptr) {
    return false;
  }
  char text[64];
  const bool answers = std::fgets(text, sizeof text, gnuplot) != nullptr;
  return pclose(gnuplot) == 0 && answers;
}

// What goes on, in one line that is written over on a terminal.
class ProgressLine {
 public:
  bool tell(const std::string& scene, const std::string& text) {
    if (shows_) {
      std::fprintf(stderr, "\r\033[K%s: %s", scene.c_str(), text.c_str());
    } else if (scene != scene_) {
      std::fprintf(stderr, "%s\n", scene.c_str());
    }
    scene_ = scene;
    return !interrupted.is_raised();
  }
  void end() const {
    if (shows_) {
      std::fprintf(stderr, "\r\033[K");
    }
  }

 private:
  bool shows_ = isatty(STDERR_FILENO) != 0;
  std::string scene_;
};

int write_all(const ChartOptions& options, const std::vector<ChartSheet>& sheets) {
  const Provenance made = provenance();
  const std::filesystem::path folder = options.folder;
  for (const auto& [name, text] :
       {std::pair(std::string("chart.csv"), chart_csv(sheets, made)),
        std::pair(std::string("chart.gp"), chart_script(sheets, made))}) {
    if (const auto written = write_text((folder / name).string(), text, Existing::replace);
        !written) {
      complain(written.error().message);
      return exit_code::wrong_use;
    }
  }
  std::printf("%s: %s\n", (folder / "chart.csv").c_str(),
              counted(sheets.size(), "scene", "scenes").c_str());
  if (!has_gnuplot()) {
    complain(
        "no pictures: gnuplot is not installed (Debian: apt install gnuplot-nox); then run "
        "'gnuplot chart.gp' in " +
        options.folder);
    return exit_code::done;
  }
  if (!draw(options.folder)) {
    complain("gnuplot failed on " + (folder / "chart.gp").string());
    return exit_code::our_failure;
  }
  std::printf("%s: overview.png, overview.svg and one of each for every scene\n",
              options.folder.c_str());
  return exit_code::done;
}

}  // namespace

Result<ChartSheet> make_sheet(const ChartScene& asked, Isa isa, double patience_s,
                              const Tells& tells) {
  const ChartScene scene = sounds(asked, isa) ? asked : struck(asked);
  if (!sounds(scene, isa)) {
    return Error{scene.name + ": no output moves, even when it is struck"};
  }
  ChartSheet sheet{.scene = scene.name, .about = scene.about, .is_linear = scene.is_linear};
  if (!tells("the reference")) {
    return sheet;
  }
  const Starts starts(scene);
  auto references = find_references(scene, starts.at(1), isa);
  if (!references) {
    return Error{scene.name + ": " + references.error().message};
  }
  sheet.reference[0] = references->identical.how;
  sheet.reference[1] = references->physical.how;
  sheet.is_linear = references->continuous.has_value();
  sheet.floor_db = references->physical.floor_db;
  sheet.window = references->window;
  std::vector<Heard> all = hear_all(starts, isa, tells);
  Poles published;
  if (references->continuous && !all.empty()) {
    published = poles_of(scene, *references->continuous, all[0].made);
  }
  const Stress stress(scene, isa);
  std::vector<MadeWay> ways;
  for (Heard& heard : all) {
    if (!tells("judging " + heard.made.way.name)) {
      return ChartSheet{};
    }
    ChartRow row{.way = heard.made.way,
                 .methods = heard.made.methods,
                 .twins = heard.made.twins,
                 .predicted_ns = heard.made.predicted_ns(),
                 .judged = judge(scene, *references, published, heard.made, heard.waves)};
    row.failure = !row.judged.is_finite ? "out of all bounds" : stress.verdict(row.way);
    heard.waves = {};
    ways.push_back(std::move(heard.made));
    sheet.rows.push_back(std::move(row));
  }
  if (patience_s > 0.0 && tells("timing " + counted(ways.size(), "way", "ways"))) {
    const Timing timing = time_ways(ways, patience_s, [&] { return !tells("timing"); });
    sheet.timed_s = timing.seconds;
    sheet.rounds = timing.rounds;
    for (std::size_t i = 0; i < ways.size() && timing.rounds > 0; ++i) {
      sheet.rows[i].ns = timing.ns[i];
      sheet.rows[i].upper_ns = timing.upper_ns[i];
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
    complain("the folder '" + options.folder + "' cannot be made: " + error.message());
    return exit_code::wrong_use;
  }
  std::vector<ChartScene> scenes;
  for (const std::string& name : options.scenes.empty() ? reference_scenes() : options.scenes) {
    auto scene = chart_scene(name);
    if (!scene) {
      complain(scene.error().message);
      return exit_code::wrong_use;
    }
    scenes.push_back(*std::move(scene));
  }
  stay_on_one_core();
  ProgressLine progress;
  std::vector<ChartSheet> sheets;
  for (const ChartScene& scene : scenes) {
    auto sheet = make_sheet(scene, best_isa(), options.patience_s, [&](const std::string& text) {
      return progress.tell(scene.name, text);
    });
    if (!sheet) {
      progress.end();
      complain(sheet.error().message);
      return exit_code::wrong_use;
    }
    if (interrupted.is_raised()) {
      break;
    }
    sheets.push_back(*std::move(sheet));
  }
  progress.end();
  if (interrupted.is_raised()) {
    complain("interrupted; what is complete is written");
  }
  const int code = sheets.empty() ? exit_code::our_failure : write_all(options, sheets);
  return interrupted.is_raised() ? exit_code::our_failure : code;
}

}  // namespace ressort::commands
