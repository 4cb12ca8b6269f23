// app/realtime: the MIDI implementation chart: every message, and what it does.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::realtime {

struct MidiChartRow {
  std::string_view message;
  std::string_view number;  // or values; empty where there is none
  bool is_received = true;
  std::string_view does;
};

// What `ressort reference midi` prints. [any thread]
std::span<const MidiChartRow> midi_chart();

}  // namespace ressort::realtime
