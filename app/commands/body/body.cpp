#include "app/commands/body/body.h"

#include <cstdio>
#include <string_view>
#include <utility>

#include "app/commands/body/resonances.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/sound_file.h"
#include "core/solids/surface.h"

namespace ressort::commands {
namespace {

// Returns the kind of a file that cannot be read, by its first bytes.
std::string_view likely_kind(std::string_view bytes) {
  constexpr std::pair<std::string_view, std::string_view> kinds[] = {
      {"glTF", "glTF, a 3D scene"},
      {"PK\x03\x04", "a ZIP archive, such as 3MF"},
      {"ISO-10303", "a STEP drawing"},
      {"#VRML", "a VRML scene"},
      {"<?xml", "XML"},
      {"MThd", "a MIDI file"},
      {"\x89PNG", "a picture"},
      {"%PDF", "a PDF document"},
      {"  0\nSECTION", "a DXF drawing"}};
  for (const auto& [start, kind] : kinds) {
    if (bytes.starts_with(start)) {
      return kind;
    }
  }
  return bytes.find('\0') == std::string_view::npos ? "text" : "data of an unknown kind";
}

// Reports the given options that an input of this kind does not use, where `used` names the used
// ones outside its own group, and rejects a preset as output of anything but a recording.
int check_options(const BodyRequest& request, std::string_view kind, std::string_view used) {
  for (const auto& [name, group] : request.particular) {
    if (group != kind && used.find(name) == std::string_view::npos) {
      print_error(name + " has no effect on " + (kind == "statistics" ? "" : "a ") +
                  std::string(kind));
    }
  }
  if (kind != "recording" && request.output.ends_with(".toml")) {
    return reject("'" + request.output +
                  "': only a recording becomes a preset; choose a name that ends in .mdl");
  }
  return exit_code::done;
}

}  // namespace

int body_command(const BodyRequest& request) {
  if (request.input.empty()) {
    if (const int code = check_options(request, "statistics", "--modes --mass --loss")) {
      return code;
    }
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
    if (const int code = check_options(request, "model", "--modes")) {
      return code;
    }
    NetworkBodyOptions options = common(request.network);
    options.modes = static_cast<std::size_t>(request.modes.value_or(0));
    return network_body(options);
  }
  const auto bytes = read_bytes(request.input, max_solid_bytes);
  if (!bytes) {
    return reject(bytes.error().message);
  }
  if (solids::surface_format(*bytes) != solids::SurfaceFormat::unknown) {
    if (const int code = check_options(request, "solid", "--picture --modes --loss")) {
      return code;
    }
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
  if (const auto resonances = parse_resonances(*bytes)) {
    if (const int code = check_options(request, "resonance model", "--mass")) {
      return code;
    }
    return resonance_body(*resonances, common(request.recording), request.mass);
  }
  if (!SoundReader::open(request.input)) {
    return reject("'" + request.input + "' looks like " + std::string(likely_kind(*bytes)) +
                  "; bodies are made of sound files, of solids in STL, OBJ, PLY or OFF, of "
                  "resonance models (frequency, amplitude, bandwidth) and of .mdl models");
  }
  if (const int code = check_options(request, "recording", "--picture --modes --mass")) {
    return code;
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
