// A libFuzzer target: any MIDI bytes, cut into any packets, are played or counted as malformed. One
// byte gives the length of the next packet; its highest bit selects the input.
#include "app/devices/midi_input.h"
#include "tests/fuzz/player.h"
#include "tests/system/every_control.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  static const auto preset =
      parse_preset(support::PresetWriter(fuzz::network(), "fuzz.mdl", 0).write());
  require(preset.ok());
  auto compiled =
      compile_network(fuzz::network(), preset.preset, {.rate_hz = fuzz::Harness::rate_hz});
  require(static_cast<bool>(compiled));
  fuzz::Harness harness(*std::move(compiled));
  MidiSink door(harness.process);
  MidiReader reader;
  std::vector<MidiPacket> packets;
  std::span<const std::uint8_t> rest(data, size);
  while (!rest.empty() && packets.size() < 64) {
    const std::uint8_t head = rest[0];
    const auto packet = rest.subspan(1, std::min<std::size_t>(rest.size() - 1, head & 0x7f));
    rest = rest.subspan(1 + packet.size());
    if ((head & 0x80) != 0) {
      door.arrive(reader, packet, harness.time_ns + head);
    } else {
      packets.push_back({static_cast<std::uint32_t>(packets.size()), packet});
    }
  }
  harness.block(512, packets);
  harness.block(512);
  return 0;
}
