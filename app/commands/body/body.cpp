#include "app/commands/body/body.h"

#include <cstdio>

#include "app/commands/output.h"
#include "app/exit_code.h"

namespace ressort::commands {

int body_command(const BodyRequest& request) {
  if (request.input.empty()) {
    StatisticalBodyOptions options = request.statistical;
    options.statistics.mass = request.mass;
    options.statistics.loss = request.loss;
    options.output = request.output;
    options.force = request.force;
    options.most_modes = request.modes.value_or(options.most_modes);
    return statistical_body(options);
  }
  const bool is_model = request.input.ends_with(".mdl") || request.input.ends_with(".toml");
  if (!is_model && !request.network.chain.empty()) {
    std::fprintf(
        stderr,
        "--chain needs a model: convert the file to a body first, then the body to a chain\n");
    return exit_code::wrong_use;
  }
  const auto common = [&](auto options) {
    options.input = request.input;
    options.output = request.output;
    options.force = request.force;
    return options;
  };
  if (is_model) {
    NetworkBodyOptions options = common(request.network);
    options.modes = static_cast<std::size_t>(request.modes.value_or(0));
    return network_body(options);
  }
  if (is_solid_file_name(request.input)) {
    if (request.loss.size() > 1) {
      return reject("--loss: a solid has one loss factor; give one number");
    }
    SolidBodyOptions options = common(request.solid);
    if (!request.loss.empty()) {
      options.loss = request.loss.front()[1];
    }
    options.picture = request.picture;
    options.modes = request.modes.value_or(options.modes);
    return solid_body(options);
  }
  BodyOptions options = common(request.recording);
  options.picture = request.picture;
  options.mass = request.mass;
  if (request.modes) {
    options.modes = static_cast<std::size_t>(*request.modes);
  }
  return recording_body(options);
}

}  // namespace ressort::commands
