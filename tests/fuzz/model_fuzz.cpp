// A libFuzzer target: any text is read as a model or rejected with a position and a message. A
// model that is read survives printing and parsing. If it is not too large it is exported, compiled
// and played, and its output is finite.
#include "core/model/faust/faust.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/fuzz/player.h"
#include "tests/system/every_control.h"

namespace ressort::fuzz {
namespace {

constexpr std::size_t frames = 4096;
constexpr std::size_t block_frames = 256;
constexpr std::uint64_t most_nodes = 120;  // For speed only: the reader accepts millions.

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

// Keys, every gesture of an input, controllers, and each parameter in turn to both ends and beyond;
// panic before the last block.
std::vector<Event> events_of(const Instrument& instrument, std::size_t block) {
  const auto input = static_cast<std::uint16_t>(1 + block % 3);
  const std::array<Event, 9> gestures = {{
      {.frame = 8,
       .kind = EventKind::gesture,
       .gesture = Gesture::force,
       .index = input,
       .value = 1.0,
       .value2 = 0.0005},
      {.frame = 16,
       .kind = EventKind::gesture,
       .gesture = Gesture::position,
       .index = input,
       .value = -0.5},
      {.frame = 24,
       .kind = EventKind::gesture,
       .gesture = Gesture::pluck,
       .index = input,
       .value = 1.0},
      {.frame = 40,
       .kind = EventKind::gesture,
       .gesture = Gesture::bow,
       .index = input,
       .value = 1.0,
       .value2 = 0.5},
      {.frame = 48, .kind = EventKind::bend, .value = block % 2 == 0 ? 1.0 : -1.0},
      {.frame = 50, .kind = EventKind::pressure, .value = 1.0},
      {.frame = 52, .kind = EventKind::custom, .index = input, .value = 1.0},
      {.frame = 54, .kind = EventKind::controller, .index = input, .value = 1.0},
      {.frame = 80, .kind = EventKind::note_off, .index = 69},
  }};
  std::vector<Event> events = {
      {.kind = EventKind::note_on, .index = std::uint16_t(block % 2 == 0 ? 69 : 40), .value = 0.8}};
  events.insert(events.end(), gestures.begin(), gestures.end());
  if (!instrument.parameters.empty()) {
    const std::size_t index = block % instrument.parameters.size();
    const ParameterInfo& info = instrument.parameters[index];
    for (const double value : {info.maximum, info.minimum, 1e6, info.value}) {
      events.push_back({.frame = 100,
                        .kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(index),
                        .value = value});
    }
  }
  if (block + 2 == frames / block_frames) {
    events.push_back({.frame = 200, .kind = EventKind::panic});
  }
  return events;
}

void play_blocks(Engine& engine, const Instrument& instrument, std::size_t first,
                 std::size_t last) {
  std::vector<double> audio(block_frames);
  for (std::size_t n = 0; n < block_frames; ++n) {
    audio[n] = std::sin(0.3 * static_cast<double>(n));
  }
  const std::vector<const double*> inputs(static_cast<std::size_t>(instrument.audio_inputs),
                                          audio.data());
  std::vector<std::array<double, block_frames>> heard(static_cast<std::size_t>(instrument.outputs));
  std::vector<double*> outputs;
  for (auto& channel : heard) {
    outputs.push_back(channel.data());
  }
  for (std::size_t block = first; block < last; ++block) {
    engine.process(events_of(instrument, block), inputs, outputs, block_frames);
    for (const auto& channel : heard) {
      for (const double sample : channel) {
        require(std::isfinite(sample));
      }
    }
  }
  require(std::isfinite(engine.meters().energy) && std::isfinite(engine.meters().loss));
}

// Plays like `play`, with --force if necessary: with a computed gain if none is given, and an
// upgrade to a slower-to-find form halfway, which continues the sound.
void play(const Network& network, Preset preset, CompileOptions options) {
  auto first = compile_network(network, preset, options);
  if (!first) {
    return require(!first.error().message.empty());
  }
  if (first->stability.verdict == Verdict::unstable) {
    require(first->stability.complaint.has_value());
    options.force = true;
    first = compile_network(network, preset, options);
    require(static_cast<bool>(first));
  }
  constexpr std::size_t blocks = frames / block_frames;
  play_blocks(*first->engine, first->instrument, 0, blocks / 2);
  preset.gain = first->instrument.gain;
  options.find_gain = false;
  options.most_modes = patient_modes;
  const auto second = compile_network(network, preset, options);
  require(static_cast<bool>(second));
  second->engine->continue_from(*first->engine);
  play_blocks(*second->engine, second->instrument, blocks / 2, blocks);
}

// Returns every second label that can be fixed.
std::vector<std::string> fixed_labels(const Network& network) {
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < network.macros.size(); i += 2) {
    labels.push_back(network.macros[i].name);
  }
  for (std::size_t i = 0; i < network.links.size(); i += 2) {
    labels.emplace_back(std::string_view(network.links[i].name));
  }
  return labels;
}

void play(const Network& network) {
  Preset preset = default_preset(network, false);
  preset.fixed = fixed_labels(network);
  play(network, preset, {.rate_hz = 48000.0, .most_modes = quick_modes, .find_gain = true});
  play(network, default_preset(network, true), {.rate_hz = 44100.0, .bare = true});
  const std::size_t turn = network.links.size() + 7 * network.masses.size();
  const auto written = parse_preset(support::PresetWriter(network, "fuzz.mdl", turn).write());
  if (written.ok()) {  // The name may be invalid in TOML, or a range too wide.
    play(network, written.preset, {.rate_hz = 48000.0, .most_modes = quick_modes});
  }
}

}  // namespace
}  // namespace ressort::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const ParsedNetwork parsed = parse_network(fuzz::text_of(data, size));
  fuzz::check_told(parsed);
  if (parsed.ok() && fuzz::is_small(parsed.network)) {
    const ParsedNetwork again = parse_network(print_network(parsed.network));
    require(again.ok() && again.network == parsed.network);
    std::vector<ParameterSetting> sliders(parsed.network.parameters.size());
    const auto faust = faust_text(parsed.network, {.name = "fuzz", .sliders = sliders});
    require(faust ? !faust->empty() : !faust.error().message.empty());
    fuzz::play(parsed.network);
  }
  return 0;
}
