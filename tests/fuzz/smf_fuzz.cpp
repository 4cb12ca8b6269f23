// A libFuzzer target: any bytes are read as a MIDI file or rejected with a message. The result is
// in order and its messages are complete. midi_fuzz tests their effect.
#include <cmath>
#include <cstdlib>

#include "app/commands/smf/midi_file.h"
#include "tests/support/rooms.h"

namespace {

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  const auto midi = parse_midi_file({data, size});
  if (!midi) {
    require(!midi.error().message.empty());
    return 0;
  }
  require(midi->bytes.size() <= 2 * size);  // Each data byte may get its running status.
  require(std::isfinite(midi->length_s) && midi->length_s <= 86400.0);
  double before_s = 0.0;
  for (const MidiFile::Message& message : midi->messages) {
    require(message.time_s >= before_s && message.time_s <= midi->length_s);
    before_s = message.time_s;
    const auto bytes = midi->bytes_of(message);
    require(!bytes.empty() &&
            bytes.data() + bytes.size() <= midi->bytes.data() + midi->bytes.size());
  }
  return 0;
}
