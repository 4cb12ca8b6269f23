#include "core/model/faust/faust_header.h"

#include <algorithm>
#include <vector>

#include "core/model/faust/faust_words.h"

namespace ressort::model {
namespace {

std::string meaning_of_input(const Network& network, std::span<const std::string> masses,
                             int number) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  for (const Input& input : network.inputs) {
    if (input.number == number) {
      add((input.is_force ? "force on " : "position of ") + masses[input.mass]);
    }
  }
  for (const Parameter& parameter : network.parameters) {
    if (parameter.audio_input == number) {
      add("parameter " + plain(parameter.name));
    }
  }
  return text.empty() ? "not used" : text;
}

}  // namespace

std::string faust_header(const Network& network, std::span<const std::string> masses,
                         const std::string& name, int inputs) {
  const auto moving = std::count_if(network.masses.begin(), network.masses.end(),
                                    [](const Mass& mass) { return model::moves(mass); });
  std::string text = "// " + plain(name) +
                     ", a network of masses and springs: " + std::to_string(moving) +
                     " that move, " + std::to_string(network.links.size()) + " links.\n";
  for (int n = 1; n <= inputs; ++n) {
    text += "// input " + std::to_string(n) + ": " + meaning_of_input(network, masses, n) + "\n";
  }
  std::vector<std::string> heard(static_cast<std::size_t>(output_count(network)));
  for (const Output& output : network.outputs) {
    std::string& sum = heard[static_cast<std::size_t>(output.number - 1)];
    sum += (sum.empty() ? "" : ", ") +
           ((output.is_force ? "force on " : "position of ") + masses[output.mass]);
  }
  for (std::size_t n = 0; n < heard.size(); ++n) {
    text += "// output " + std::to_string(n + 1) + ": " +
            (heard[n].empty() ? std::string("silent") : heard[n]) + "\n";
  }
  return text + "declare name \"" + plain(name) + "\";\n\n";
}

}  // namespace ressort::model
