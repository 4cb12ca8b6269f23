// A libFuzzer target: whatever text comes, it is read or refused with a place and a sentence; what
// is read comes back from its print, and if it is not too large it is exported, compiled and
// played, and what is heard is finite.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "core/compile/compile.h"
#include "core/model/faust.h"
#include "core/model/mdl.h"
#include "core/model/print.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

constexpr std::size_t frames = 128;
constexpr std::uint64_t most_nodes = 300;  // for speed alone: the reader takes millions

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

void check_told(const ParsedNetwork& parsed) {
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    require(diagnostic.line >= 1 && diagnostic.column >= 1 && diagnostic.length >= 1);
    require(!diagnostic.message.empty() && !to_string(diagnostic, "fuzz.mdl").empty());
  }
}

bool is_small(const Network& network) {
  std::uint64_t nodes = network.masses.size();
  for (const Macro& macro : network.macros) {
    nodes += node_count(macro);
  }
  return nodes <= most_nodes;
}

// A key, every gesture that an input can be asked for, and the first parameter turned up and off.
constexpr std::array<Event, 9> gestures = {{
    {.frame = 0, .kind = EventKind::note_on, .index = 69, .value = 0.8},
    {.frame = 8, .kind = EventKind::force, .index = 1, .value = 1.0, .value2 = 0.0005},
    {.frame = 16, .kind = EventKind::position, .index = 1, .value = -0.5},
    {.frame = 24, .kind = EventKind::pluck, .index = 1, .value = 1.0},
    {.frame = 32, .kind = EventKind::parameter, .index = 0, .value = 1e6},
    {.frame = 40, .kind = EventKind::bow, .index = 1, .value = 1.0, .value2 = 0.5},
    {.frame = 48, .kind = EventKind::bend, .value = 1.0},
    {.frame = 64, .kind = EventKind::parameter, .index = 0, .value = 0.0},
    {.frame = 80, .kind = EventKind::note_off, .index = 69},
}};

void play(const Network& network, bool bare) {
  auto compiled = compile(network, default_preset(network, bare),
                          {.rate_hz = bare ? 44100.0 : 48000.0, .bare = bare});
  if (!compiled) {
    return require(!compiled.error().message.empty());
  }
  std::vector<double> audio(frames);
  for (std::size_t n = 0; n < frames; ++n) {
    audio[n] = std::sin(0.3 * static_cast<double>(n));
  }
  const std::vector<const double*> inputs(
      static_cast<std::size_t>(compiled->instrument.audio_inputs), audio.data());
  std::vector<std::array<double, frames>> heard(
      static_cast<std::size_t>(compiled->instrument.outputs));
  std::vector<double*> outputs;
  for (auto& channel : heard) {
    outputs.push_back(channel.data());
  }
  compiled->engine->process(gestures, inputs, outputs, frames);
  for (const auto& channel : heard) {
    for (const double sample : channel) {
      require(std::isfinite(sample));
    }
  }
}

}  // namespace
}  // namespace ressort

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  const ParsedNetwork parsed =
      parse_network(std::string_view(reinterpret_cast<const char*>(data), size));
  check_told(parsed);
  if (parsed.ok() && is_small(parsed.network)) {
    const ParsedNetwork again = parse_network(print_network(parsed.network));
    require(again.ok() && again.network == parsed.network);
    std::vector<ParameterSetting> sliders(parsed.network.parameters.size());
    const auto faust = faust_text(parsed.network, {.name = "fuzz", .sliders = sliders});
    require(faust ? !faust->empty() : !faust.error().message.empty());
    play(parsed.network, false);
    play(parsed.network, true);
  }
  return 0;
}
