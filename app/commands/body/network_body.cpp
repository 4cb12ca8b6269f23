// Converts the modes of a model to a body or a chain.
#include <algorithm>
#include <cstdio>

#include "app/commands/body/body.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/body.h"
#include "core/model/language/print.h"
#include "core/model/language/tokens.h"

namespace ressort::commands {
namespace {

// Returns inputs and outputs, so that the body can be played immediately.
std::string ports_of(const PlacedModes& body) {
  std::string text;
  for (const std::string& place : body.places) {
    const bool is_input = place.starts_with("in");
    text += "@" + place + (is_input ? " frcInput [@" : " posOutput [@") + body.name + " " + place +
            "]\n";
  }
  return text;
}

// Finds the place of the chain: a place of a body, or an input or an output, named as by
// `placed_modes`. Adds an input there if the model has none. Returns the name of the place.
std::string listen_at(Network& network, const std::string& place) {
  for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
    const std::vector<std::string>& places = network.macros[i].places;
    const auto found = std::ranges::find(places, place);
    if (found == places.end()) {
      continue;
    }
    const double last = static_cast<double>(std::max<std::size_t>(places.size(), 2) - 1);
    const ArgumentId u = network.add(static_cast<double>(found - places.begin()) / last);
    const auto mass = static_cast<std::uint32_t>(network.masses.size());
    network.masses.push_back(
        {.kind = MassKind::point, .tap = static_cast<std::uint32_t>(network.taps.size())});
    network.taps.push_back({.macro = i, .u = u});
    const int number = input_count(network) + 1;
    network.inputs.push_back({.number = number, .is_force = true, .mass = mass});
    return "in" + std::to_string(number);
  }
  return place;
}

// The first mass of a chain is both struck and heard.
std::string ports_of(const ModalChain& chain) {
  const auto first = std::ranges::find_if(chain.network.masses, moves);
  const std::string name = first->name.text();
  return "@in1 frcInput @" + name + "\n@out1 posOutput @" + name + "\n";
}

}  // namespace

int network_body(const NetworkBodyOptions& options) {
  const Progress progress = report_stages(options.input);
  auto scene = load_scene(options.input, {.progress = progress});
  if (!scene) {
    return reject(scene.error().message);
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return reject(spared.error().message);
  }
  const std::string place = options.chain.empty() ? "" : listen_at(scene->network, options.chain);
  const auto modes = find_modes(scene->network, start_values(*scene),
                                {.count = options.modes, .progress = progress});
  if (!modes) {
    return reject(to_string(finding_in_model(*scene, modes.error())));
  }
  PlacedModes body = placed_modes(*modes);
  body.name = is_identifier(scene->name) ? scene->name : "body";
  if (body.modes.empty() || body.places.empty()) {
    return reject(
        options.input +
        ": no mode is both driven by an input and heard at an output, so there is no body");
  }
  if (options.modes > 0 && body.modes.size() > options.modes) {
    body.modes.resize(options.modes);
  }
  std::string text = "# The modes of " + scene->name +
                     " in the published scheme, at its inputs and "
                     "outputs.\n";
  if (!options.chain.empty()) {
    const auto chain = chain_of(body, place);
    if (!chain) {
      return reject(options.input + ": " + chain.error().message);
    }
    text = "# A chain with the response of " + scene->name + " at " + options.chain +
           "; largest error of a T60: " + fixed(chain->worst_t60_percent, 2) + " %.\n" +
           print_network(chain->network) + ports_of(*chain);
  } else {
    if (body.left_out > 1e-3) {
      std::fprintf(
          stderr,
          "warning: the places move with different phases, which a body cannot represent; up to "
          "%.1f %% of a mode is lost\n",
          100.0 * body.left_out);
    }
    text += body_text(body) + ports_of(body);
  }
  if (options.output.empty()) {
    std::fputs(text.c_str(), stdout);
    return std::fflush(stdout) == 0 ? exit_code::done : exit_code::our_failure;
  }
  if (const int code = write_output(options.output, text, options.force); code != exit_code::done) {
    return code;
  }
  std::printf("%s: %s, %s\n", options.output.c_str(),
              counted(body.modes.size(), "mode", "modes").c_str(),
              counted(body.places.size(), "place", "places").c_str());
  return exit_code::done;
}

}  // namespace ressort::commands
