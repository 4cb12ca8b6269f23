// app/realtime: the MIDI implementation chart, with the effect of every message.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::realtime {

struct MidiChartRow {
  std::string_view message;
  std::string_view number;  // number or values; empty if there is none
  bool is_received = true;
  std::string_view does;
};

// Returns the rows that `ressort reference midi` prints. [any thread]
std::span<const MidiChartRow> midi_chart();

}  // namespace ressort::realtime
