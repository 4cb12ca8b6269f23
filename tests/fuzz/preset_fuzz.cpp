// A libFuzzer target: any text is read as a preset and as a mapping of controllers, or rejected
// with a position and a message. A preset that is read is applied to a model with all elements, and
// played.
#include "core/model/preset/preset.h"

#include "app/control/registry.h"
#include "core/model/preset/controllers.h"
#include "tests/fuzz/player.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const ParsedPreset parsed = parse_preset(fuzz::text_of(data, size), is_reserved);
  const ParsedControllers mapping = parse_controllers(fuzz::text_of(data, size));
  for (const std::vector<Error>* errors : {&parsed.errors, &mapping.errors}) {
    for (const Error& error : *errors) {
      require(!error.message.empty() && error.line >= 1 && error.column >= 1);
    }
  }
  if (!parsed.ok()) {
    return 0;
  }
  const Preset& preset = parsed.preset;
  require(preset.voices >= 1 && preset.voices <= max_voices);
  auto compiled =
      compile_network(fuzz::network(), preset,
                      {.rate_hz = fuzz::Harness::rate_hz, .voices = std::min(preset.voices, 3)});
  if (!compiled) {
    require(!compiled.error().message.empty() && compiled.error().line >= 1);
    return 0;
  }
  fuzz::Harness harness(*std::move(compiled));
  std::vector<std::uint8_t> bytes = {0x90, 60, 100, 0xd0, 90, 0xe0, 0, 0};
  for (std::uint8_t number = 0; number < 120; ++number) {
    bytes.insert(bytes.end(), {0xb0, number, static_cast<std::uint8_t>(127 - number)});
  }
  const MidiPacket packet{3, bytes};
  harness.block(512, std::span(&packet, 1));
  for (const CustomInfo& custom : harness.instrument.custom) {
    const auto row = static_cast<std::uint16_t>(custom.row);
    const TimedEvent event{{.kind = EventKind::custom, .index = row, .value = 1.0}};
    harness.process.send(harness.process.from_osc, {&event, 1});
  }
  harness.block(512);
  return 0;
}
