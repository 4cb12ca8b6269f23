// Compares compiled FAUST exports with renders, sample by sample, for every element, law and place.
// Needs the faust compiler and a C++ compiler.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "app/session/sound_file.h"
#include "core/model/faust/faust.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/support/thorough.h"
#include "tests/system/faust_models.h"

using namespace ressort;

namespace {

namespace fs = std::filesystem;

constexpr std::size_t frames = 2000;
constexpr std::size_t channels = 7;  // channels of the input; the most that a model uses
constexpr double tolerance = 1e-9;   // fraction of each channel's peak

// The program around all compiled exports: `runner NAME RATE IN OUT [PARAMETER VALUE]` runs one of
// them over raw interleaved doubles.
const char* const runner_start = R"(
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <algorithm>
#include <map>
#include <string>
#include <vector>
#define FAUSTFLOAT double
struct Meta { void declare(const char*, const char*) {} };
struct UI {
  std::map<std::string, double*> sliders;
  void openVerticalBox(const char*) {}
  void closeBox() {}
  void declare(double*, const char*, const char*) {}
  void addHorizontalSlider(const char* name, double* zone, double, double, double, double) {
    sliders[name] = zone;
  }
};
struct dsp {
  virtual ~dsp() {}
  virtual int getNumInputs() = 0;
  virtual int getNumOutputs() = 0;
  virtual void init(int) = 0;
  virtual void buildUserInterface(UI*) = 0;
  virtual void compute(int, double**, double**) = 0;
};
)";

const char* const runner_end = R"(
std::vector<double> read(const char* path) {
  std::vector<double> all;
  if (FILE* file = std::fopen(path, "rb")) {
    double block[4096];
    for (std::size_t n; (n = std::fread(block, 8, 4096, file)) > 0;) all.insert(all.end(), block, block + n);
    std::fclose(file);
  }
  return all;
}
int main(int argc, char** argv) {
  dsp* d = make(argv[1]);
  if (!d) return 3;
  d->init(std::atoi(argv[2]));
  UI ui;
  d->buildUserInterface(&ui);
  if (argc > 6) {
    if (!ui.sliders.count(argv[5])) return 4;
    *ui.sliders[argv[5]] = std::atof(argv[6]);
  }
  const std::vector<double> in = read(argv[3]);
  const int frames = static_cast<int>(in.size() / CHANNELS);
  std::vector<std::vector<double>> from(CHANNELS, std::vector<double>(frames));
  for (int n = 0; n < frames; ++n)
    for (int c = 0; c < CHANNELS; ++c) from[c][n] = in[n * CHANNELS + c];
  std::vector<std::vector<double>> to(d->getNumOutputs(), std::vector<double>(frames));
  std::vector<double*> inputs, outputs;
  for (auto& x : from) inputs.push_back(x.data());
  for (auto& y : to) outputs.push_back(y.data());
  if (d->getNumInputs() > CHANNELS) return 5;
  d->compute(frames, inputs.data(), outputs.data());
  FILE* file = std::fopen(argv[4], "wb");
  for (int n = 0; n < frames; ++n)
    for (auto& y : to) std::fwrite(&y[n], 8, 1, file);
  return std::fclose(file);
}
)";

void run(const std::string& command) {
  const int code = std::system(command.c_str());
  INFO(command);
  REQUIRE(code == 0);
}

void write(const fs::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  REQUIRE(file.good());
}

// Returns slow motions and blows on every channel: forces, positions and parameters at once.
std::vector<double> gesture() {
  std::vector<double> samples;
  std::vector<support::Motion> hands;
  for (std::size_t c = 0; c < channels; ++c) {
    hands.emplace_back(c + 1, 20.0, 200.0);
  }
  for (std::size_t n = 0; n < frames; ++n) {
    for (std::size_t c = 0; c < channels; ++c) {
      const double blow = n % 500 == 60 * c ? 0.1 : 0.0;
      samples.push_back((c == 0 ? 0.01 : 0.4) * hands[c](n) + blow);
    }
  }
  return samples;
}

class Harness {
 public:
  // Exports all models and compiles them into one program. A FAUST program by hand replaces the
  // export of the model with its name.
  explicit Harness(const std::vector<std::pair<std::string, std::string>>& models,
                   const std::string& options = "",
                   const std::map<std::string, std::string>& by_hand = {})
      : options_(options),
        folder_(fs::temp_directory_path() / ("ressort-faust-" + std::to_string(getpid()))) {
    fs::create_directory(folder_);
    input_ = gesture();
    std::ofstream raw(folder_ / "in.raw", std::ios::binary);
    raw.write(reinterpret_cast<const char*>(input_.data()),
              static_cast<std::streamsize>(input_.size() * sizeof(double)));
    std::string runner = runner_start;
    std::string make = "dsp* make(const std::string& name) {\n";
    for (const auto& [name, text] : models) {
      write(folder_ / (name + ".mdl"), text);
      if (const auto found = by_hand.find(name); found != by_hand.end()) {
        write(folder_ / (name + ".dsp"), found->second);
      } else {
        run(std::string(RESSORT_PROGRAM) + " export " + path(name + ".mdl") + " --to faust -o " +
            path(name + ".dsp") + options);
      }
      run("faust -double -lang cpp -cn " + name + "_dsp " + path(name + ".dsp") + " -o " +
          path(name + ".h"));
      runner += "#include \"" + name + ".h\"\n";
      make += "  if (name == \"" + name + "\") return new " + name + "_dsp;\n";
    }
    write(folder_ / "runner.cpp", "#define CHANNELS " + std::to_string(channels) + "\n" + runner +
                                      make + "  return nullptr;\n}\n" + runner_end);
    run(std::string(RESSORT_CXX) + " -std=c++17 -O0 -ffp-contract=off -w " + path("runner.cpp") +
        " -o " + path("runner"));
  }
  ~Harness() {
    std::error_code error;
    fs::remove_all(folder_, error);
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  // Returns the largest difference between the render and the compiled program, as a share of the
  // channel's peak.
  double difference(const std::string& name, int rate_hz, const std::string& parameter = "",
                    const std::string& value = "") {
    auto wav = SoundWriter::open(path("in.wav"),
                                 {.rate_hz = static_cast<double>(rate_hz),
                                  .channels = static_cast<int>(channels),
                                  .samples = SampleFormat::float64},
                                 Existing::replace);
    REQUIRE(wav);
    REQUIRE(wav->write(input_.data(), frames));
    REQUIRE(wav->close());
    run(std::string(RESSORT_PROGRAM) + " render " + path(name + ".mdl") +
        " -q --format double -r " + std::to_string(rate_hz) + " --frames " +
        std::to_string(frames) + " --input " + path("in.wav") + " -o " + path("expected.wav") +
        options_ + (parameter.empty() ? "" : " --set " + parameter + "=" + value));
    run(path("runner") + " " + name + " " + std::to_string(rate_hz) + " " + path("in.raw") + " " +
        path("found.raw") + " " + parameter + " " + value);
    const auto expected = read_sound(path("expected.wav"));
    REQUIRE(expected);
    return compare(expected->channels);
  }

 private:
  double compare(const std::vector<std::vector<double>>& expected) const {
    std::vector<double> found(expected.size() * frames + 1);
    std::ifstream raw(folder_ / "found.raw", std::ios::binary);
    raw.read(reinterpret_cast<char*>(found.data()),
             static_cast<std::streamsize>(found.size() * sizeof(double)));
    REQUIRE(raw.gcount() ==
            static_cast<std::streamsize>(expected.size() * frames * sizeof(double)));
    double worst = 0.0;
    double loudest = 0.0;
    for (std::size_t c = 0; c < expected.size(); ++c) {
      support::Comparison channel;
      for (std::size_t n = 0; n < frames; ++n) {
        channel.add(expected[c][n], found[n * expected.size() + c]);
      }
      loudest = std::max(loudest, channel.peak);
      worst = std::max(worst, channel.peak > 0.0 ? channel.relative() : channel.worst);
    }
    REQUIRE(loudest > 1e-6);
    REQUIRE(loudest < 1e6);
    return worst;
  }

  std::string options_;
  fs::path folder_;
  std::vector<double> input_;
};

}  // namespace

TEST_CASE("a compiled FAUST export gives the samples of a render", "[export]") {
  Harness harness(scenes::faust_models());
  for (const auto& [name, text] : scenes::faust_models()) {
    const double found = harness.difference(name, 44100);
    INFO(name << " differs by " << support::show(found));
    CHECK(found < tolerance);
  }
  std::size_t number = 0;
  for (const int rate_hz : {32000, 48000, 96000}) {
    for (const char* name : {"newer_start",
                             "older_start",
                             "places",
                             "driven",
                             "clipped_spring",
                             "bow",
                             "smooth_bow",
                             "clipped_contact",
                             "damped_pluck",
                             "wiring",
                             "raised_string",
                             "falling",
                             "waveguide",
                             "open_waveguide",
                             "held_waveguide",
                             "waveguides_on_a_box",
                             "laws_on_waveguides",
                             "hammer_on_a_waveguide",
                             "stretched_on_waveguides",
                             "driven_ends_of_waveguides"}) {
      if (!support::is_in_turn(number++, 3)) {
        continue;
      }
      const double found = harness.difference(name, rate_hz);
      INFO(name << " at " << rate_hz << " Hz differs by " << support::show(found));
      CHECK(found < tolerance);
    }
  }
  CHECK(harness.difference("poly_triangle", 44100, "m_K", "0.2") < tolerance);
  CHECK(harness.difference("turned_bow", 44100, "p", "1") < tolerance);
  for (const auto& [name, value] : {std::pair("f", "441"), std::pair("t", "0.02"),
                                    std::pair("b", "1"), std::pair("R", "0.4")}) {
    CHECK(harness.difference("held_waveguide", 44100, name, value) < tolerance);
  }
}

// Synth-A-Modeler's translation: forces from all positions one sample before, then x += v with
// v += f/(m fs^2). Its filters are those of FAUST's libraries.
TEST_CASE("a Synth-A-Modeler model with filters agrees with its translation to FAUST", "[export]") {
  const std::string name = "synth_a_modeler";
  Harness harness(
      {{name,
        "faustcode: low=highpass(4,20.0);\nport(),hand;\nmass(0.01,0.0,0.0),a;\n"
        "mass(0.03,0.0,0.0),b;\nground(0.0),g;\nlink(300.0,0.01,0.0),l0,hand,a;\n"
        "link(4400.0,0.003,0.0),l1,a,b;\nlink(2200.0,0.02,0.0),l2,b,g;\n"
        "audioout,o1,a*(1000.0):low;\naudioout,o2,(a-b*0.3):lowpass(3,800.0):dcblocker;\n"
        "audioout,o3,l1:highpass(1,500.0);\naudioout,o4,b:smooth(0.99)*2.0;\n"}},
      "",
      {{name,
        "import(\"stdfaust.lib\");\n"
        "link(k,R,x,y) = k*(x-y) + R*44100*((x-y)-(x-y)');\n"
        "mass(m) = /(m*44100*44100) : (+ ~ _) : (+ ~ _);\n"
        "network(a,b,hand) = (l0-l1 : mass(0.01)), (l1-l2 : mass(0.03)), l1 with {\n"
        "  l0 = link(300.0,0.01,hand',a); l1 = link(4400.0,0.003,a,b);\n"
        "  l2 = link(2200.0,0.02,b,0.0);\n};\n"
        "heard(a,b,l1) = (a*1000.0 : fi.highpass(4,20.0)),\n"
        "  (a-b*0.3 : fi.lowpass(3,800.0) : fi.dcblocker), (l1 : fi.highpass(1,500.0)),\n"
        "  (b : si.smooth(0.99) : *(2.0));\n"
        "process = network ~ (_,_) : heard;\n"}});
  CHECK(harness.difference(name, 44100) < tolerance);
}

TEST_CASE("every law is exported, on a mass and on a waveguide", "[export]") {
  Harness harness(scenes::models_of_laws());
  std::size_t number = 0;
  for (const auto& [name, text] : scenes::models_of_laws()) {
    for (const int rate_hz : {44100, 48000}) {
      if (!support::is_in_turn(number++, 2)) {
        continue;
      }
      const double found = harness.difference(name, rate_hz);
      INFO(name << " at " << rate_hz << " Hz differs by " << support::show(found));
      CHECK(found < tolerance);
    }
  }
}

// The export reads a law's facts and nothing else. So a law that only this test knows takes the
// place of another one with the same arguments, and its own FAUST text must compile: a contact
// whose hysteresis is a damper that grows with the slope of D^P.
TEST_CASE("a new law needs only its facts to be exported", "[export]") {
  std::vector<laws::LawFacts> table(laws::law_table().begin(), laws::law_table().end());
  laws::LawFacts& felt = table[static_cast<std::size_t>(laws::law_named("power_contact"))];
  felt.name = "felt";
  felt.faust = R"(
felt(k, p, z, t, d, v) = select2(d > 0.0 - t, 0.0, k*deep(p) + z*p*v*deep(p - 1.0))
with {
  deep(n) = pow(max(d + t, 1e-300), n);
};
steady_felt(k, p, z, t, now, speed, way) = 0.0,
  0.5*z*p*select2(now + t > 0.0, 0.0, pow(max(now + t, 1e-300), p - 1.0));
gradient_felt(k, p, z, t, b) = discrete(energy, force, slope, b + t)
with {
  deep(d, n) = select2(d > 0.0, 0.0, pow(max(d, 1e-300), n));
  energy(d) = k/(p + 1.0)*deep(d, p + 1.0);
  force(d) = k*deep(d, p);
  slope(d) = k*p*deep(d, p - 1.0);
};
)";
  const fs::path folder = fs::temp_directory_path() / ("ressort-felt-" + std::to_string(getpid()));
  fs::create_directory(folder);
  const std::string numbers = " @in2 0.03 1.5 0.02 ";
  const auto mass = scenes::law("powerContact @m" + numbers + "0.05");
  const auto touching = scenes::on_a_waveguide("powerContact [@s 0.4]" + numbers + "0.05");
  const auto apart = scenes::on_a_waveguide("powerContact [@s 0.4]" + numbers + "-0.05");
  for (const auto& [name, model, call] :
       {std::tuple("mass", mass, "felt(0.03*r*r, 1.5, 0.02*r, 0.05"),
        std::tuple("touching", touching, " : start_felt;"),
        std::tuple("apart", apart, " : alone_felt;")}) {
    const model::Network network = support::network_of(model);
    std::vector<model::ParameterSetting> sliders;
    for (const model::Parameter& parameter : network.parameters) {
      sliders.push_back({parameter.name, parameter.value, 0.0, 1.0, parameter.location});
    }
    const auto text = model::faust_text(network, {.name = name, .sliders = sliders, .laws = table});
    REQUIRE(text);
    INFO(*text);
    CHECK(text->find(call) != std::string::npos);
    CHECK(text->find("power_contact") == std::string::npos);
    const std::string path = (folder / name).string();
    write(path + ".dsp", *text);
    run("faust -double -lang cpp " + path + ".dsp -o " + path + ".h");
  }
  fs::remove_all(folder);
}

TEST_CASE("an export without rescaling has the same coefficients at every rate", "[export]") {
  std::vector<std::pair<std::string, std::string>> few;
  for (const auto& model : scenes::faust_models()) {
    if (model.first == "newer_start" || model.first == "bow" || model.first == "places") {
      few.push_back(model);
    }
  }
  Harness harness(few, " --no-rescale");
  for (const auto& [name, text] : few) {
    const double found = harness.difference(name, 96000);
    INFO(name << " differs by " << support::show(found));
    CHECK(found < tolerance);
  }
}
