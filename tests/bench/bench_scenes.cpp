#include "tests/bench/bench_scenes.h"

#include <cmath>
#include <numbers>

#include "tests/support/networks/scenes.h"

namespace ressort::bench {
namespace {

using Hand = std::function<double(std::size_t, std::size_t)>;

double sine(double reach, double cycles, std::size_t frame) {
  return reach * std::sin(2.0 * std::numbers::pi * cycles * static_cast<double>(frame) /
                          static_cast<double>(cycle_frames));
}

// --- hands --------------------------------------------------------------------------------------

constexpr double away = 0.5;  // a distance at which no finger touches anything

// All inputs oscillate slowly with the amplitude `reach`.
Hand swing(double reach, double cycles = 1.0) {
  return [=](std::size_t, std::size_t frame) { return sine(reach, cycles, frame); };
}

// A force impulse of one sample.
Hand blow(double force) {
  return [=](std::size_t, std::size_t frame) { return frame == 0 ? force : 0.0; };
}

// The pick touches the string for half a block to excite it, and then nothing touches it.
Hand flick(double reach) {
  return [=](std::size_t input, std::size_t frame) {
    return input == 0 && frame < block_frames / 2 ? reach : away;
  };
}

// The pick stays within the reach of its law, and all fingers touch the string.
Hand lean(double reach) {
  return [=](std::size_t input, std::size_t frame) {
    return input == 0 ? sine(reach, 1.0, frame) : -away + sine(0.1, 1.0, frame);
  };
}

// Moves back and forth at a constant speed per sample.
Hand draw(double speed) {
  return [=](std::size_t, std::size_t frame) {
    const std::size_t half = cycle_frames / 2;
    return 1.0 + speed * static_cast<double>(frame < half ? frame : cycle_frames - frame);
  };
}

// --- texts --------------------------------------------------------------------------------------

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::string cubic_mesh() {
  return replaced(replaced(scenes::mesh_20x30(), " springDamper ", " nlSpring3 "),
                  " mesh_K mesh_Z\n", " mesh_K 0.5 mesh_Z\n");
}

// A longer text would exceed the limit for models, so a macro is used instead.
constexpr int most_written_masses = 100'000;

std::string chain(int masses) {
  if (masses > most_written_masses) {
    return "@str string " + std::to_string(masses) +
           " 1. 0.1 0.01 0. 0. 0.\n@in1 frcInput [@str 0.3]\n@out1 posOutput [@str 0.7]\n";
  }
  return scenes::string("str", masses, "0.1", "0.01") + "@in1 frcInput @str_m" +
         std::to_string(masses * 3 / 10) + "\n" +
         scenes::output(1, "str_m" + std::to_string(masses * 7 / 10));
}

std::string mesh(int side) {
  const std::string n = std::to_string(side);
  if (side * side > most_written_masses) {
    return "@mesh cornerMesh " + n + " " + n +
           " 1. 0.1 0.01 0. 0. 0.\n@in1 frcInput [@mesh 0.3 0.4]\n"
           "@out1 posOutput [@mesh 0.7 0.6]\n";
  }
  const auto node = [&](int i, int j) {
    return "mesh_m" + std::to_string(side * i / 10) + "_" + std::to_string(side * j / 10);
  };
  return scenes::square_mesh("mesh", side, side, "0.1", "0.01") + "@in1 frcInput @" + node(3, 4) +
         "\n" + scenes::output(1, node(7, 6));
}

// Returns a random graph: three links of the same law from each mass to others.
std::string random_graph(int masses, const std::string& law) {
  std::string text = "@g ground 0.\n";
  std::string links = "@hold springDamper @m_m0 @g 0.05 0.001\n";
  std::uint32_t seed = 1;
  const auto any = [&] {
    seed = seed * 1664525u + 1013904223u;
    return static_cast<int>((seed >> 8) % static_cast<std::uint32_t>(masses));
  };
  for (int i = 0; i < masses; ++i) {
    text += "@m_m" + std::to_string(i) + " mass 1. 0. 0.\n";
    for (int k = 0; k < 3; ++k) {
      const int other = (i + 1 + any() % (masses - 1)) % masses;
      links += "@m_r" + std::to_string(3 * i + k) + " " + law + "\n";
      links.replace(links.rfind("@A @B"), 5,
                    "@m_m" + std::to_string(i) + " @m_m" + std::to_string(other));
    }
  }
  return text + links + "@in1 frcInput @m_m1\n" + scenes::output(1, "m_m2");
}

// Returns a waveguide tuned to C2, with its exciter.
std::string waveguide(const std::string& finger) {
  return "@hz param 65.40639\n@s waveguide 0.5 hz 4. 0.8 0.\n" + finger +
         "@out1 posOutput [@s 0.8]\n";
}

// --- scenes -------------------------------------------------------------------------------------

void add_instruments(std::vector<BenchScene>& all) {
  using namespace scenes;
  all.push_back({"IPlayTheTriangle", iplay_the_triangle(), swing(0.2)});
  all.push_back({"IPlayTheTriangle-contact", iplay_the_triangle(), lean(0.002)});
  all.push_back({"IPlayTheTriangle-free", iplay_the_triangle(), flick(0.004)});
  all.push_back({"PolyTriangle", poly_triangle(), blow(0.1)});
  all.push_back({"PhysicalLFO", physical_lfo(), blow(0.1)});
  all.push_back(
      {"Resonator", resonator(), swing(0.5, 80.0), {{"K", 0.25, 0.05}, {"Z", 0.01, 0.002}}});
  all.push_back({"BowedString", bowed_string(), draw(2e-5), {{"low_K", 0.28, 0.02}}});
  all.push_back({"PluckedHarmonics", plucked_harmonics(), flick(0.02)});
  all.push_back({"PluckedHarmonics-contact", plucked_harmonics(), lean(0.02)});
  all.push_back({"LargeTriangleMesh", large_triangle_mesh(), flick(0.01)});
  all.push_back({"LargeTriangleMesh-contact", large_triangle_mesh(), lean(0.01)});
  all.push_back({"20x30mesh", mesh_20x30(), blow(0.1)});
  all.push_back({"20x30mesh-cubic", cubic_mesh(), blow(0.1)});
  all.push_back({"1000massString", string_1000(), swing(1.0)});
  all.push_back({"random-300", random_graph(300, "springDamper @A @B 0.05 0.001"), blow(0.1)});
  all.push_back(
      {"random-300-cubic", random_graph(300, "nlSpring3 @A @B 0.05 0.5 0.001"), blow(0.1)});
}

void add_voices(std::vector<BenchScene>& all) {
  for (const std::size_t voices : {1u, 4u, 16u, 64u, 256u}) {
    all.push_back({.name = "PolyTriangle-" + std::to_string(voices) + "voices",
                   .text = scenes::poly_triangle(),
                   .hand = blow(0.1),
                   .voices = voices,
                   .tuned_by = "m_K"});
  }
  for (const std::size_t voices : {1u, 4u, 16u, 64u, 256u}) {
    all.push_back({.name = "IPlayTheTriangle-" + std::to_string(voices) + "voices",
                   .text = scenes::iplay_the_triangle(),
                   .hand = lean(0.002),
                   .voices = voices,
                   .tuned_by = "m_K"});
  }
}

void add_waveguides(std::vector<BenchScene>& all) {
  const std::string struck = waveguide("@in1 frcInput [@s 0.25]\n");
  for (const std::size_t voices : {1u, 8u, 64u}) {
    all.push_back({.name = "waveguide-" + std::to_string(voices) + "voices",
                   .text = struck,
                   .hand = blow(0.1),
                   .voices = voices,
                   .tuned_by = "hz"});
  }
  all.push_back({"waveguide-plucked",
                 waveguide("@in1 posInput 0.\n@pick nlPluck @in1 [@s 0.25] 0.1 0.02\n"),
                 flick(0.02)});
}

void add_families(std::vector<BenchScene>& all) {
  for (const int masses : {10, 100, 1000, 10'000, 100'000, 1'000'000}) {
    all.push_back({.name = "chain-" + std::to_string(masses),
                   .text = chain(masses),
                   .hand = blow(0.1),
                   .family = "chains",
                   .elements = static_cast<std::size_t>(masses) * 2});
  }
  for (const int side : {10, 30, 100, 300, 1000}) {
    all.push_back({.name = "mesh-" + std::to_string(side) + "x" + std::to_string(side),
                   .text = mesh(side),
                   .hand = blow(0.1),
                   .family = "meshes",
                   .elements = static_cast<std::size_t>(side * side) * 3});
  }
}

// Returns whether everything that can touch touches all the time. In the other scenes contacts are
// short or rare, which is cheap for a few masses.
bool is_worst(const std::string& name) {
  const auto starts = [&](const char* text) { return name.starts_with(text); };
  return name.ends_with("-contact") || (starts("IPlay") && name.ends_with("voices")) ||
         name == "Resonator" || name == "BowedString" || name == "1000massString" ||
         name == "20x30mesh-cubic" || starts("random-300") || starts("waveguide") ||
         (starts("chain-") && name != "chain-10") || starts("mesh-") || starts("20x30");
}

}  // namespace

double Turn::at(std::size_t frame) const {
  return middle + sine(reach, 3.0, frame);
}

std::vector<BenchScene> all_scenes() {
  std::vector<BenchScene> all;
  add_instruments(all);
  add_voices(all);
  add_waveguides(all);
  add_families(all);
  for (BenchScene& scene : all) {
    scene.is_worst = is_worst(scene.name);
  }
  return all;
}

std::string text_with_channels(const BenchScene& scene, std::size_t inputs) {
  std::string text = scene.text;
  for (const Turn& turn : scene.turns) {
    const std::string declared = "@" + turn.parameter + " param ";
    const std::size_t from = text.find(declared);
    text.replace(from, text.find('\n', from) - from,
                 "@" + turn.parameter + " audioParam @in" + std::to_string(++inputs));
  }
  return text;
}

}  // namespace ressort::bench
