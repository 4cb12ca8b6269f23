// A model's own modes as a body, or as a chain.
#include <cstdio>

#include "app/commands/body/body.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/load_news.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/body.h"
#include "core/model/language/print.h"
#include "core/model/language/tokens.h"

namespace ressort {
namespace {

int refuse(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  return exit_code::wrong_use;
}

// Its inputs and outputs, so that it can be played at once.
std::string ports_of(const PlacedModes& body) {
  std::string text;
  for (const std::string& place : body.places) {
    const bool is_input = place.starts_with("in");
    text += "@" + place + (is_input ? " frcInput [@" : " posOutput [@") + body.name + " " + place +
            "]\n";
  }
  return text;
}

}  // namespace

int network_body(const NetworkBodyOptions& options) {
  LoadNews news(options.input,
                [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); });
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    return true;  // Ctrl-C ends it at once
  });
  auto scene = load_scene(options.input, {.progress = progress});
  if (!scene) {
    return refuse(scene.error().message);
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = spare(options.output, read); !spared) {
    return refuse(spared.error().message);
  }
  const auto modes = find_modes(scene->network, start_values(*scene),
                                {.count = options.modes, .progress = progress});
  if (!modes) {
    return refuse(to_string(finding_in_model(*scene, modes.error())));
  }
  PlacedModes body = placed_modes(*modes);
  body.name = is_identifier(scene->name) ? scene->name : "body";
  if (body.modes.empty() || body.places.empty()) {
    return refuse(options.input +
                  ": nothing that an input pushes and an output hears swings, so there is no body "
                  "to be made of it");
  }
  if (options.modes > 0 && body.modes.size() > options.modes) {
    body.modes.resize(options.modes);
  }
  std::string text = "# The modes of " + scene->name +
                     " as the published scheme plays them, at its "
                     "inputs and outputs.\n";
  if (!options.chain.empty()) {
    const auto chain = chain_of(body, options.chain);
    if (!chain) {
      return refuse(options.input + ": " + chain.error().message);
    }
    text = "# A chain that answers as " + scene->name + " does at " + options.chain +
           "; a decay is off by at most " + fixed(chain->worst_t60_percent, 2) + " %.\n" +
           print_network(chain->network);
  } else {
    if (body.left_out > 1e-3) {
      std::fprintf(stderr,
                   "its places swing at different times, which those of a body cannot: up to "
                   "%.1f %% of a mode is left out\n",
                   100.0 * body.left_out);
    }
    text += body_text(body) + ports_of(body);
  }
  if (options.output.empty()) {
    std::fputs(text.c_str(), stdout);
    return std::fflush(stdout) == 0 ? exit_code::done : exit_code::our_failure;
  }
  if (const int code = put_text(options.output, text, options.force); code != exit_code::done) {
    return code;
  }
  std::printf("%s: %s, %s\n", options.output.c_str(),
              counted(body.modes.size(), "mode", "modes").c_str(),
              counted(body.places.size(), "place", "places").c_str());
  return exit_code::done;
}

}  // namespace ressort
