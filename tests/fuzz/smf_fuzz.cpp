// A libFuzzer target: whatever bytes are given for a MIDI file, they are read or refused with a
// place and a sentence; what is read is in order, and is played or counted.
#include <cmath>

#include "app/commands/smf/midi_file.h"
#include "app/devices/midi_input.h"
#include "tests/fuzz/player.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const auto midi = parse_midi_file({data, size});
  if (!midi) {
    require(!midi.error().message.empty());
    return 0;
  }
  require(midi->bytes.size() <= 2 * size);  // each data byte may stand with its running status
  require(std::isfinite(midi->length_s) && midi->length_s <= 86400.0);
  auto compiled = compile(fuzz::network(), default_preset(fuzz::network(), false),
                          {.rate_hz = fuzz::Harness::rate_hz});
  require(static_cast<bool>(compiled));
  fuzz::Harness harness(*std::move(compiled));
  MidiDoor door(harness.process);
  MidiReader reader;
  double before_s = 0.0;
  for (const MidiFile::Message& message : midi->messages) {
    require(message.time_s >= before_s && message.time_s <= midi->length_s);
    before_s = message.time_s;
    require(message.count > 0 && message.first + message.count <= midi->bytes.size());
    door.arrive(reader, midi->bytes_of(message), harness.time_ns);
  }
  harness.block(512);
  harness.block(512);
  return 0;
}
