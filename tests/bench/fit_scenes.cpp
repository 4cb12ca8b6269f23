#include <cmath>
#include <numbers>

#include "tests/bench/bench_scenes.h"
#include "tests/support/networks/scenes.h"

namespace ressort::bench {
namespace {

constexpr double reach = 0.01;

// Every input moves all the time, within the reach of its pluck.
double hand(std::size_t input, std::size_t frame) {
  return reach * std::sin(2.0 * std::numbers::pi * static_cast<double>((input + 1) * frame) /
                          static_cast<double>(cycle_frames));
}

// Nodes to hold on to, spread over a body of `count`, which `name` gives.
template <class Name>
std::string touched(std::size_t count, std::size_t plucks, std::size_t outputs, const Name& name) {
  std::string text;
  const auto at = [&](std::size_t i, std::size_t of) {
    return name((2 * i + 1) * count / (2 * of));
  };
  for (std::size_t i = 0; i < plucks; ++i) {
    const std::string n = std::to_string(i + 1);
    text += "@in" + n + " posInput 0.\n@pick" + n + " nlPluck @in" + n + " @" + at(i, plucks) +
            " 0.05 0.02\n";
  }
  if (plucks == 0) {
    text += "@in1 frcInput @" + at(0, 3) + "\n";
  }
  for (std::size_t i = 0; i < outputs; ++i) {
    text += scenes::output(static_cast<int>(i + 1), at(i, outputs));
  }
  return text;
}

std::string string_of(int masses, std::size_t plucks, std::size_t outputs = 1) {
  return scenes::string("s", masses, "0.1", "0.01") +
         touched(static_cast<std::size_t>(masses), plucks, outputs,
                 [](std::size_t i) { return "s_m" + std::to_string(i); });
}

// The same with other words in some places.
std::string replaced(const std::string& text, const std::string& word, const std::string& by) {
  std::string all;
  std::size_t from = 0;
  for (std::size_t at = text.find(word); at != text.npos; at = text.find(word, from)) {
    all.append(text, from, at - from).append(by);
    from = at + word.size();
  }
  return all.append(text, from);
}

std::string mesh_of(int side, std::size_t plucks, std::size_t outputs, bool is_cubic = false) {
  std::string text = scenes::square_mesh("m", side, side, "0.1", "0.01");
  if (is_cubic) {
    text =
        replaced(replaced(text, " springDamper ", " nlSpring3 "), " m_K m_Z\n", " m_K 0.5 m_Z\n");
  }
  // The corners hold.
  const auto inner = static_cast<std::size_t>(side - 2);
  return text + touched(inner * inner, plucks, outputs, [&](std::size_t i) {
           return "m_m" + std::to_string(1 + i / inner) + "_" + std::to_string(1 + i % inner);
         });
}

}  // namespace

std::vector<BenchScene> fit_scenes() {
  std::vector<BenchScene> all;
  const auto add = [&](std::string name, std::string text, std::size_t voices = 1) {
    all.push_back({.name = "fit-" + std::move(name),
                   .text = std::move(text),
                   .hand = hand,
                   .voices = voices,
                   .is_worst = true});
  };
  for (const int masses : {2, 3, 4, 6, 8, 12, 16}) {
    for (const std::size_t plucks : {0u, 1u, 2u, 3u}) {
      const std::string name =
          "string-" + std::to_string(masses) + "-" + std::to_string(plucks) + "plucks";
      if (static_cast<int>(plucks) < masses) {
        add(name, string_of(masses, plucks));
      }
      for (const std::size_t voices : {8u, 16u, 64u}) {
        if (plucks < 2 && (masses < 5 || masses % 8 == 0)) {
          add(name + "-" + std::to_string(voices) + "voices", string_of(masses, plucks), voices);
        }
      }
    }
  }
  add("string-8-4outputs", string_of(8, 0, 4));
  for (const int masses : {30, 60, 90, 150, 300, 600, 1500, 3000, 6000, 20'000, 50'000}) {
    for (const std::size_t plucks : {0u, 1u, 4u}) {
      if (masses <= 1500 || plucks == 0) {
        add("string-" + std::to_string(masses) + "-" + std::to_string(plucks) + "plucks",
            string_of(masses, plucks, plucks == 4 ? 3 : 1));
      }
    }
  }
  for (const int side : {8, 16, 25, 60, 200}) {
    for (const std::size_t plucks : {0u, 1u, 3u, 6u, 12u}) {
      if (side <= 25 || plucks == 0) {
        add("mesh-" + std::to_string(side) + "-" + std::to_string(plucks) + "plucks",
            mesh_of(side, plucks, plucks == 3 ? 4 : 1));
      }
    }
  }
  for (const int side : {12, 40, 120}) {
    add("cubic-mesh-" + std::to_string(side), mesh_of(side, 0, 1, true));
  }
  for (const char* const form :
       {"string 60", "string 600", "cornerMesh 12 12", "cornerMesh 40 40"}) {
    const std::string place = std::string(form).starts_with("string") ? " 0.3]" : " 0.3 0.4]";
    for (const std::string more :
         {"", "@in2 frcInput [@s 0.6 0.6]\n@out2 posOutput [@s 0.2 0.2]\n"}) {
      if (more.empty() || !std::string(form).starts_with("string")) {
        add(form + std::string(more.empty() ? "-places" : "-more-places"),
            "@s " + std::string(form) + " 1. 0.1 0.01 0. 0. 0.\n@in1 frcInput [@s" + place +
                "\n@out1 posOutput [@s" + place + "\n" + more);
      }
    }
  }
  for (const int masses : {40, 200}) {
    add("string-" + std::to_string(masses) + "-moving", string_of(masses, 0));
    all.back().turns = {{"s_K", 0.1, 0.02}};
  }
  for (const int side : {10, 20}) {
    add("mesh-" + std::to_string(side) + "-moving", mesh_of(side, 0, 1));
    all.back().turns = {{"m_K", 0.1, 0.02}};
  }
  return all;
}

}  // namespace ressort::bench
