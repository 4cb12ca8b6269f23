// What the product costs: every scene in every method and precision, beside the textbook simulator
// and, if asked for, beside what FAUST makes of the same model. See `run --help`.
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
#include "tests/bench/fit.h"
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
    "  SCENE        a name or a pattern such as 'chain-*'; without one, all\n"
    "  --faust      beside the exported model, compiled by faust and g++ and clang++\n"
    "  --fit        measures what the plan reckons with, over sizes, and writes it as\n"
    "               core/kernels/prices/*.h for this instruction set; two minutes\n"
    "  --quick      a glance: less exact\n"
    "  --isa NAME   base, v3 or v4; without it, the best of this machine\n"
    "  --seconds S  to measure each scene for; 4 without it\n"
    "  -o DIR       where bench.csv, cost.svg and faust.svg go; build/bench without it\n"
    "  --list       the scenes' names\n";

struct Options {
  bool faust = false;
  bool fits = false;
  bool lists = false;
  Isa isa = best_isa();
  double seconds = 4.0;
  std::filesystem::path folder = "build/bench";
  std::vector<std::string> patterns;
};

volatile std::sig_atomic_t stops = 0;  // Ctrl-C

// Of what this machine has.
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
    } else if (argument == "--fit") {
      options.fits = true;
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
  const auto svg = plot::to_svg(figure);
  if (!svg) {
    std::fprintf(stderr, "%s: %s\n", path.c_str(), svg.error().message.c_str());
    return;
  }
  std::ofstream(path) << *svg;
}

// --- one scene ----------------------------------------------------------------------------------

// The machine in every form that it has.
std::vector<Formed> forms_of(const Machine& machine) {
  std::vector<Formed> forms;
  for (const Method method : methods_for(KernelRow::Use::published)) {
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
  const Planned planned =
      make_plan(forms.front().machine,
                {.is_double = is_double, .isa = isa, .voices = static_cast<int>(scene.voices)});
  all.emplace_back("ressort", is_double,
                   play_engine(scene, network, planned.machine, precision, isa));
  all.back().form = method_name(planned.parts.front().method);
  all.back().calibrate();
  std::move(kernels.begin(), kernels.end(), std::back_inserter(all));
}

Workload load_of(const BenchScene& scene, bool is_double, Isa isa) {
  return {.is_double = is_double,
          .isa = isa,
          .voices = static_cast<int>(scene.voices),
          .moving = scene.turns.empty() ? 0.0 : 1.0};
}

std::string faust_name(const FaustLibrary& library) {
  return "faust " + library.variant;
}

// How many times faster the row is than all others of the same scene.
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

// What the machine can do at most.
struct Limits {
  double double_per_ns = 0.0;  // multiply-adds
  double float_per_ns = 0.0;
};

void compare(Row& row, const BenchScene& scene, const std::vector<Formed>& forms,
             const Limits& limits, Isa isa) {
  const auto form = std::find_if(forms.begin(), forms.end(),
                                 [&](const Formed& formed) { return formed.method == row.method; });
  if (form == forms.end()) {
    return;
  }
  if (scene.is_worst) {
    row.predicted_ns = predicted_ns(form->machine.parts[0], load_of(scene, row.is_double, isa));
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
    compare(rows.back(), scene, forms, limits, options.isa);
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
  if (!options.patterns.empty()) {
    std::ranges::move(fit_scenes(), std::back_inserter(scenes));
  }
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
  // The compilers run on all cores, before anything is measured.
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
  print_predictions(rows);
  print_regrets(rows);
  const bool is_written = write_csv(options.folder / "bench.csv", isa, rows);
  const std::string machine = machine_line(isa);
  draw(cost_figure(machine, rows), options.folder / "cost.svg");
  draw(faust_figure(machine, rows), options.folder / "faust.svg");
  return stops != 0 ? 130 : is_written ? 0 : 1;
}

// --- prices -------------------------------------------------------------------------------------

void add_samples(const BenchScene& scene, const Options& options, std::vector<Sample>& samples) {
  constexpr double seconds = 0.1;
  constexpr double most_dear = 100.0;  // times the cheapest: nobody would take it
  Prepared prepared{scene, {}, {}};
  if (!prepare(prepared, options)) {
    return;
  }
  const std::vector<Formed> forms = forms_of(make_machine(prepared.network, rate_hz, true));
  std::vector<Timed> all;
  std::vector<Sample> found;
  for (const bool is_double : {true, false}) {
    const Workload load = load_of(scene, is_double, options.isa);
    double least_ns = std::numeric_limits<double>::infinity();
    for (const Formed& formed : forms) {
      const Program& program = formed.machine.parts[0];
      const KernelRow& row = row_of(program.form);
      all.emplace_back(formed.method, is_double,
                       is_double
                           ? play_kernels<double>(scene, prepared.network, program, options.isa)
                           : play_kernels<float>(scene, prepared.network, program, options.isa));
      const double ns = all.back().calibrate();
      least_ns = std::min(least_ns, ns);
      if (ns > most_dear * least_ns) {
        all.pop_back();
        continue;
      }
      found.push_back({scene.name, row.method, is_double, row.work(program, load), ns});
    }
  }
  measure(all, seconds, stops);
  for (std::size_t i = 0; i < all.size() && all[i].has_played(); ++i) {
    found[i].ns = all[i].quantile(0.25);
    samples.push_back(found[i]);
  }
}

int fit(const Options& options) {
  if (!std::filesystem::exists(path_of(options.isa))) {
    std::fprintf(stderr, "--fit is for the folder of the source\n");
    return 2;
  }
  stay_on_one_core();
  const DenormalsFlushed flushed;
  std::vector<BenchScene> scenes = fit_scenes();
  for (BenchScene& scene : all_scenes()) {
    if (scene.is_worst) {
      scenes.push_back(std::move(scene));
    }
  }
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < scenes.size() && stops == 0; ++i) {
    show_progress(i, scenes.size(), scenes[i].name);
    add_samples(scenes[i], options, samples);
  }
  show_progress(scenes.size(), scenes.size(), "");
  if (stops != 0) {
    return 130;
  }
  const Prices prices = fitted(prices_of(options.isa), samples);
  print_errors(prices, samples);
  return write(prices, options.isa, machine_line(std::string(isa_name(options.isa)))) ? 0 : 1;
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
  return options->fits ? fit(*options) : run(*options);
}
