// Measures the cost of every scene in every method and precision, next to a textbook simulator and,
// with --faust, next to FAUST's code for the same model. See `run --help`.
#include <fnmatch.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <utility>

#include "app/realtime/denormals.h"
#include "core/compile/plan.h"
#include "core/model/language/mdl.h"
#include "tests/bench/figures.h"
#include "tests/bench/limit.h"
#include "tests/bench/measure.h"
#include "tests/bench/report.h"

namespace {

using namespace ressort;
using namespace ressort::bench;

constexpr double rate_hz = 44100.0;
constexpr std::size_t most_reference_elements = 3000;
constexpr std::size_t most_faust_elements = 3000;

const char* const usage =
    "usage: tests/bench/run [OPTION...] [SCENE...]\n"
    "  SCENE        name or pattern such as 'chain-*' (default: all)\n"
    "  --faust      compare with the exported model, compiled by faust, g++ and clang++\n"
    "  --quick      measure briefly and less accurately\n"
    "  --isa NAME   instruction set: base, v3 or v4 (default: the best of this machine)\n"
    "  --seconds S  time for each scene (default 4)\n"
    "  -o DIR       output folder (default build/bench): bench.csv, cost.svg, faust.svg\n"
    "  --list       print the names of the scenes\n";

struct Options {
  bool faust = false;
  bool lists = false;
  Isa isa = best_isa();
  double seconds = 4.0;
  std::filesystem::path folder = "build/bench";
  std::vector<std::string> patterns;
};

volatile std::sig_atomic_t stops = 0;  // Ctrl-C

// Returns an instruction set by name if this machine has it.
std::optional<Isa> isa_of(const std::string& name) {
  constexpr std::array<std::pair<const char*, Isa>, 3> all{
      {{"base", Isa::base}, {"v3", Isa::v3}, {"v4", Isa::v4}}};
  for (const auto& [known, isa] : all) {
    if (known == name && has_isa(isa)) {
      return isa;
    }
  }
  return std::nullopt;
}

std::optional<Options> read(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    const bool has_value = argument == "--isa" || argument == "--seconds" || argument == "-o";
    if (has_value && i + 1 == arguments.size()) {
      return std::nullopt;
    }
    if (argument == "--faust") {
      options.faust = true;
    } else if (argument == "--list") {
      options.lists = true;
    } else if (argument == "--quick") {
      options.seconds = 0.05;
    } else if (argument == "--isa") {
      const auto isa = isa_of(arguments[++i]);
      if (!isa) {
        return std::nullopt;
      }
      options.isa = *isa;
    } else if (argument == "--seconds") {
      options.seconds = std::atof(arguments[++i].c_str());
    } else if (argument == "-o") {
      options.folder = arguments[++i];
    } else if (argument.starts_with("-")) {
      return std::nullopt;
    } else {
      options.patterns.push_back(argument);
    }
  }
  return options;
}

bool is_wanted(const BenchScene& scene, const std::vector<std::string>& patterns) {
  return patterns.empty() ||
         std::any_of(patterns.begin(), patterns.end(), [&](const std::string& pattern) {
           return fnmatch(pattern.c_str(), scene.name.c_str(), 0) == 0;
         });
}

void show_progress(std::size_t done, std::size_t all, const std::string& doing) {
  constexpr std::size_t width = 30;
  if (isatty(STDERR_FILENO) == 0) {
    return;
  }
  const std::size_t full = width * done / all;
  std::fprintf(stderr, "\r\033[K[%s%s] %zu/%zu %s", std::string(full, '#').c_str(),
               std::string(width - full, '.').c_str(), done, all, doing.c_str());
  if (done == all) {
    std::fprintf(stderr, "\r\033[K");
  }
}

// Writes a figure as SVG, if it has anything to show.
void draw(const plot::Figure& figure, const std::filesystem::path& path) {
  if (figure.panels.empty()) {
    return;
  }
  const auto svg = plot::draw(figure);
  if (!svg) {
    std::fprintf(stderr, "%s: %s\n", path.c_str(), svg.error().message.c_str());
    return;
  }
  std::ofstream(path) << *svg;
}

// --- one scene ----------------------------------------------------------------------------------

// Returns every form that the machine can have.
std::vector<Formed> forms_of(const Machine& machine) {
  std::vector<Formed> forms;
  for (const Method method : published_methods()) {
    auto form = machine.parts.size() == 1
                    ? row_of(method).fits({machine.parts[0], Workload{}, Budget{}, Progress{}})
                    : std::nullopt;
    if (form) {
      forms.push_back({std::string(method_name(method)), machine});
      forms.back().machine.parts[0].form = *std::move(form);
    }
  }
  return forms;
}

void add_ours(const BenchScene& scene, const Network& network, const std::vector<Formed>& forms,
              bool is_double, Isa isa, std::vector<Timed>& all) {
  std::vector<Timed> kernels;
  for (const Formed& formed : forms) {
    const Program& program = formed.machine.parts[0];
    kernels.emplace_back(formed.method, is_double,
                         is_double ? play_kernels<double>(scene, network, program, isa)
                                   : play_kernels<float>(scene, network, program, isa));
    kernels.back().calibrate();
  }
  const Precision precision = is_double ? Precision::float64 : Precision::float32;
  // The plan that `play` makes once it has measured the forms.
  const Timings timings{.time = time_of, .recall = {}, .keep = {}};
  const Planned planned =
      make_plan(forms.front().machine,
                {.is_double = is_double, .isa = isa, .voices = static_cast<int>(scene.voices)}, {},
                patient_modes, {}, {}, {}, {.timings = &timings, .forms = {}});
  all.emplace_back("ressort", is_double,
                   play_engine(scene, network, planned.machine, precision, isa));
  all.back().form = method_name(planned.parts.front().method);
  all.back().calibrate();
  std::move(kernels.begin(), kernels.end(), std::back_inserter(all));
}

std::string faust_name(const FaustLibrary& library) {
  return "faust " + library.variant;
}

// Fills in the row's speed ratios to all other players of the same scene.
void compare(Row& row, const std::vector<Timed>& all, const std::vector<FaustLibrary>& libraries) {
  for (const Timed& one : all) {
    if (one.method == "reference") {
      row.than_reference = one.median() / row.median_ns;
    }
    for (const FaustLibrary& library : libraries) {
      if (one.method != faust_name(library) || one.is_double != library.is_double) {
        continue;
      }
      if (row.is_double != library.is_double) {
        continue;
      }
      const double times = one.median() / row.median_ns;
      row.than_best_faust = std::min(times, row.than_best_faust.value_or(times));
      if (library.is_default) {
        row.than_default_faust = times;
      }
    }
  }
}

// The machine's peak arithmetic rate.
struct Limits {
  double double_per_ns = 0.0;  // multiply-adds
  double float_per_ns = 0.0;
};

void compare(Row& row, const std::vector<Formed>& forms, const Limits& limits) {
  const auto form = std::find_if(forms.begin(), forms.end(),
                                 [&](const Formed& formed) { return formed.method == row.method; });
  if (form == forms.end()) {
    return;
  }
  if (const auto work = multiply_adds(form->machine.parts[0])) {
    const double least_ns = *work * static_cast<double>(row.voices) /
                            (row.is_double ? limits.double_per_ns : limits.float_per_ns);
    row.of_limit = least_ns / row.median_ns;
  }
}

std::vector<Row> measure_scene(const BenchScene& scene, const Network& network,
                               const std::vector<FaustLibrary>& libraries, const Options& options,
                               const Limits& limits) {
  const Machine machine = make_machine(network, rate_hz, true);
  const std::vector<Formed> forms = forms_of(machine);
  std::vector<Timed> all;
  for (const bool is_double : {true, false}) {
    add_ours(scene, network, forms, is_double, options.isa, all);
  }
  if (scene.voices == 1 && scene.elements <= most_reference_elements &&
      machine.parts[0].waveguides.empty()) {
    all.emplace_back("reference", true, play_reference(scene, network));
    all.back().calibrate();
  }
  for (const FaustLibrary& library : libraries) {
    all.emplace_back(faust_name(library), library.is_double, play_faust(scene, network, library));
    all.back().calibrate();
  }
  measure(all, options.seconds, stops);
  std::vector<Row> rows;
  for (const Timed& one : all) {
    if (!one.has_played()) {
      continue;
    }
    rows.push_back({.scene = scene.name,
                    .family = scene.family,
                    .method = one.method,
                    .form = one.form,
                    .is_double = one.is_double,
                    .masses = machine.parts[0].moving,
                    .links = machine.parts[0].ends.size(),
                    .voices = scene.voices,
                    .is_worst = scene.is_worst,
                    .median_ns = one.median(),
                    .minimum_ns = one.minimum(),
                    .lower_ns = one.quantile(0.25),
                    .upper_ns = one.quantile(0.75)});
    compare(rows.back(), all, libraries);
    compare(rows.back(), forms, limits);
  }
  return rows;
}

// --- all of them --------------------------------------------------------------------------------

struct Prepared {
  BenchScene scene;
  Network network;
  std::vector<FaustLibrary> libraries;
};

bool prepare(Prepared& prepared, const Options& options) {
  const BenchScene& scene = prepared.scene;
  ParsedNetwork parsed = parse_network(scene.text);
  if (!parsed.ok()) {
    std::fprintf(stderr, "%s\n", to_string(parsed.diagnostics[0], scene.name).c_str());
    return false;
  }
  prepared.network = std::move(parsed.network);
  if (options.faust && scene.elements <= most_faust_elements) {
    prepared.libraries = faust_libraries(scene, prepared.network, options.folder / "faust");
    if (std::none_of(prepared.libraries.begin(), prepared.libraries.end(),
                     [](const FaustLibrary& library) { return library.is_default; })) {
      std::printf("%s: FAUST's default does not compile within the time\n", scene.name.c_str());
    }
  }
  return true;
}

int run(const Options& options) {
  std::vector<Prepared> wanted;
  std::vector<BenchScene> scenes = all_scenes();
  for (BenchScene& scene : scenes) {
    if (options.lists) {
      std::printf("%s\n", scene.name.c_str());
    } else if (is_wanted(scene, options.patterns)) {
      wanted.push_back({std::move(scene), {}, {}});
    }
  }
  if (wanted.empty()) {
    return options.lists ? 0 : 2;
  }
  std::filesystem::create_directories(options.folder);
  const std::string isa(isa_name(options.isa));
  std::printf("%s\n", machine_line(isa).c_str());
  // The compilers run on all cores, so they finish before anything is measured.
  for (std::size_t i = 0; i < wanted.size() && options.faust && stops == 0; ++i) {
    show_progress(i, wanted.size(), "FAUST compiles " + wanted[i].scene.name);
    if (!prepare(wanted[i], options)) {
      return 1;
    }
  }
  stay_on_one_core();
  const DenormalsFlushed flushed;
  const Limits limits{multiply_adds_per_ns(options.isa, true),
                      multiply_adds_per_ns(options.isa, false)};
  std::printf("limit: %.1f multiply-adds a nanosecond in double, %.1f in float\n",
              limits.double_per_ns, limits.float_per_ns);
  print_head();
  std::vector<Row> rows;
  for (std::size_t i = 0; i < wanted.size() && stops == 0; ++i) {
    show_progress(i, wanted.size(), wanted[i].scene.name);
    if (!options.faust && !prepare(wanted[i], options)) {
      return 1;
    }
    const std::vector<Row> found =
        measure_scene(wanted[i].scene, wanted[i].network, wanted[i].libraries, options, limits);
    show_progress(wanted.size(), wanted.size(), "");
    print(found);
    rows.insert(rows.end(), found.begin(), found.end());
    wanted[i] = {};
  }
  print_regrets(rows);
  const bool is_written = write_csv(options.folder / "bench.csv", isa, rows);
  const std::string machine = machine_line(isa);
  draw(cost_figure(machine, rows), options.folder / "cost.svg");
  draw(faust_figure(machine, rows), options.folder / "faust.svg");
  return stops != 0 ? 130 : is_written ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, [](int) { stops = 1; });
  std::signal(SIGPIPE, SIG_IGN);
  const auto options = read({argv + 1, argv + argc});
  if (!options) {
    std::fputs(usage, stderr);
    return 2;
  }
  return run(*options);
}
