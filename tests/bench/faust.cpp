#include "tests/bench/faust.h"

#include <dlfcn.h>
#include <sys/wait.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <thread>

#include "core/model/faust/faust.h"
#include "core/model/language/mdl.h"
#include "tests/bench/mi_lib.h"

namespace ressort::bench {
namespace {

namespace fs = std::filesystem;

constexpr int most_cpu_s = 120;             // limit for one compiler run
constexpr int most_kilobytes = 12'000'000;  // memory limit

// The code around the class that FAUST generates. The compiler's options define FAUSTFLOAT.
const char* const before_class = R"(
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
struct Meta { void declare(const char*, const char*) {} };
struct UI {
  std::map<std::string, FAUSTFLOAT*> sliders;
  void openVerticalBox(const char*) {}
  void closeBox() {}
  void declare(FAUSTFLOAT*, const char*, const char*) {}
  void addHorizontalSlider(const char* name, FAUSTFLOAT* zone, FAUSTFLOAT, FAUSTFLOAT, FAUSTFLOAT,
                           FAUSTFLOAT) {
    sliders[name] = zone;
  }
};
struct dsp {
  virtual ~dsp() {}
};
)";
const char* const after_class = R"(
#define EXPORT extern "C" __attribute__((visibility("default")))
EXPORT void* bench_make(int rate) {
  mydsp* made = new mydsp;
  made->init(rate);
  return made;
}
EXPORT void bench_destroy(void* it) { delete static_cast<mydsp*>(it); }
EXPORT int bench_outputs(void* it) { return static_cast<mydsp*>(it)->getNumOutputs(); }
EXPORT void bench_set(void* it, const char* slider, double value) {
  UI ui;
  static_cast<mydsp*>(it)->buildUserInterface(&ui);
  *ui.sliders.at(slider) = static_cast<FAUSTFLOAT>(value);
}
EXPORT void bench_compute(void* it, int frames, void* inputs, void* outputs) {
  static_cast<mydsp*>(it)->compute(frames, static_cast<FAUSTFLOAT**>(inputs),
                                   static_cast<FAUSTFLOAT**>(outputs));
}
)";

struct Option {
  const char* name;  // name in files
  const char* shown;
  const char* faust;
};
constexpr std::array<Option, 3> options{
    {{"scalar", "scalar", ""}, {"vec", "-vec", "-vec"}, {"mcd0", "-mcd 0", "-mcd 0"}}};
constexpr std::array<const char*, 2> compilers{"g++", "clang++"};

enum class Outcome { done, failed, interrupted };

// Ctrl-C reaches both the command and this process, since popen, unlike system, does not block it.
Outcome outcome_of(const std::string& command) {
  FILE* const pipe = popen(("ulimit -t " + std::to_string(most_cpu_s) + "; ulimit -v " +
                            std::to_string(most_kilobytes) + "; (" + command + ") >/dev/null 2>&1")
                               .c_str(),
                           "r");
  const int status = pipe == nullptr ? -1 : pclose(pipe);
  if (status == 0) {
    return Outcome::done;
  }
  const bool is_interrupted =
      WIFSIGNALED(status) ? WTERMSIG(status) == SIGINT : WEXITSTATUS(status) == 128 + SIGINT;
  return is_interrupted ? Outcome::interrupted : Outcome::failed;
}

// A program, by its file name without extension.
struct Source {
  const char* prefix;  // prefix in printed names
  bool is_export;
  fs::path base;
};

// One FAUST option in one precision, for all compilers.
class Job {
 public:
  Job(const Source& source, const Option& option, bool is_double)
      : source_(source),
        dsp_(source.base.string() + ".dsp"),
        stem_(source.base.string() + "-" + option.name + (is_double ? "-double" : "-single")),
        option_(option),
        is_double_(is_double) {}

  // Returns false if it was interrupted.
  bool build(const std::vector<std::string>& available) const {
    for (const std::string& compiler : available) {
      const std::string library = library_of(compiler);
      const std::string none = library + ".none";
      if (fs::exists(library) || fs::exists(none)) {
        continue;
      }
      Outcome outcome = translate();
      if (outcome == Outcome::done) {
        outcome = outcome_of(compiler +
                             " -std=c++17 -O3 -march=native -ffast-math -fPIC -shared "
                             "-fvisibility=hidden -w -DFAUSTFLOAT=" +
                             (is_double_ ? "double" : "float") + " '" + stem_ + ".cpp' -o '" +
                             library + ".part' && mv '" + library + ".part' '" + library + "'");
      }
      if (outcome == Outcome::failed) {
        std::ofstream{none};
      }
      if (outcome == Outcome::interrupted) {
        return false;
      }
    }
    return true;
  }

  void load(const std::vector<std::string>& available, std::vector<FaustLibrary>& all) const {
    for (const std::string& compiler : available) {
      void* const handle = dlopen(library_of(compiler).c_str(), RTLD_NOW | RTLD_LOCAL);
      if (handle == nullptr) {
        continue;
      }
      FaustLibrary library{.variant = source_.prefix + (option_.shown + (" " + compiler)),
                           .is_double = is_double_};
      library.is_default =
          source_.is_export && std::string_view(option_.faust).empty() && compiler == compilers[0];
      const auto find = [&](auto& function, const char* name) {
        function =
            reinterpret_cast<std::remove_reference_t<decltype(function)>>(dlsym(handle, name));
      };
      find(library.make, "bench_make");
      find(library.destroy, "bench_destroy");
      find(library.outputs, "bench_outputs");
      find(library.set, "bench_set");
      find(library.compute, "bench_compute");
      all.push_back(library);
    }
  }

 private:
  std::string library_of(const std::string& compiler) const {
    return stem_ + "-" + compiler + ".so";
  }

  Outcome translate() const {
    const std::string code = stem_ + ".cpp";
    if (fs::exists(code)) {
      return Outcome::done;
    }
    const std::string made = stem_ + ".h";
    const Outcome outcome =
        outcome_of(std::string("faust -lang cpp ") + (is_double_ ? "-double " : "-single ") +
                   option_.faust + " '" + dsp_ + "' -o '" + made + "'");
    if (outcome == Outcome::done) {
      std::ofstream(code) << before_class << "#include \"" << fs::path(made).filename().string()
                          << "\"\n"
                          << after_class;
    }
    return outcome;
  }

  Source source_;
  std::string dsp_;
  std::string stem_;
  Option option_;
  bool is_double_;
};

Network peer_of(const BenchScene& scene, const Network& network) {
  return parse_network(text_with_channels(scene, network.inputs.size())).network;
}

std::string exported(const Network& peer) {
  std::vector<ParameterSetting> sliders;
  for (const Parameter& parameter : peer.parameters) {
    sliders.push_back({parameter.name, parameter.value, 0.0, 4.0 * parameter.value, {}});
  }
  const auto text = faust_text(peer, {.name = "bench", .sliders = sliders});
  return text ? *text : std::string();
}

// Returns the program with its outputs multiplied by white noise.
std::string noisy(std::string text) {
  const std::string word = "process";
  text.replace(text.rfind("\n" + word) + 1, word.size(), "model_without_noise");
  return "import(\"stdfaust.lib\");\n" + text +
         "process = model_without_noise :\n"
         "  par(i, outputs(model_without_noise), *(no.noises(outputs(model_without_noise), i)));\n";
}

// Returns a name that depends on the text only, so that scenes can share a program.
fs::path base_of(const fs::path& folder, const std::string& text) {
  char name[40];
  std::snprintf(name, sizeof name, "%016zx", std::hash<std::string>{}(text + after_class));
  return folder / name;
}

}  // namespace

std::vector<FaustLibrary> faust_libraries(const BenchScene& scene, const Network& network,
                                          const fs::path& folder) {
  std::vector<std::string> available;
  for (const char* const compiler : compilers) {
    if (outcome_of(std::string("command -v ") + compiler) == Outcome::done) {
      available.push_back(compiler);
    }
  }
  fs::create_directories(folder);
  std::vector<Job> jobs;
  const auto add = [&](std::string text, const char* prefix, bool is_export) {
    text = scene.is_noisy ? noisy(std::move(text)) : std::move(text);
    const fs::path base = base_of(folder, text);
    std::ofstream(base.string() + ".dsp") << text;
    for (const Option& option : options) {
      jobs.emplace_back(Source{prefix, is_export, base}, option, true);
      jobs.emplace_back(Source{prefix, is_export, base}, option, false);
    }
  };
  const Network peer = peer_of(scene, network);
  add(exported(peer), "", true);
  if (const auto text = mi_lib_text(peer)) {
    add(*text, "mi.lib ", false);
  }
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < jobs.size(); i = next++) {
      if (!jobs[i].build(available)) {
        next = jobs.size();
      }
    }
  };
  std::vector<std::jthread> workers(std::max(1u, std::thread::hardware_concurrency()));
  for (std::jthread& worker : workers) {
    worker = std::jthread(work);
  }
  workers.clear();
  std::vector<FaustLibrary> all;
  for (const Job& job : jobs) {
    job.load(available, all);
  }
  return all;
}

}  // namespace ressort::bench
