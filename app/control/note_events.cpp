#include "app/control/note_events.h"

#include <algorithm>
#include <cmath>

#include "core/engine/midi/channels.h"

namespace ressort::control {
namespace {

// OSC floats up to 1 are a share of full velocity; integers and typed numbers are MIDI velocities.
double velocity_of(const PlayCall& call, std::size_t argument) {
  const std::string& types = call.message.types;
  const double velocity = call.arguments[argument];
  const bool is_share = types.size() > argument &&
                        (types[argument] == 'f' || types[argument] == 'd') && velocity <= 1.0;
  return is_share ? velocity : velocity / 127.0;
}

// Puts the event on the channel of the ID in this argument; ID 0 means the instrument's channel.
Events on_channel(const PlayCall& call, std::size_t id_argument, Event event) {
  const unsigned id = call.whole(id_argument);
  event.channel = id == 0 ? call.instrument.channel : note_channel(id);
  return std::vector{event};
}

Events by_key(const PlayCall& call, bool starts) {
  const double velocity = velocity_of(call, 1);
  const bool is_on = starts && velocity > 0.0;
  return on_channel(call, 2,
                    {.kind = is_on ? EventKind::note_on : EventKind::note_off,
                     .index = call.whole(0),
                     .value = is_on || !starts ? velocity : usual_release_velocity});
}

}  // namespace

Events events::note_on(const PlayCall& call) {
  return by_key(call, true);
}

Events events::note_off(const PlayCall& call) {
  return by_key(call, false);
}

// The note sounds at this frequency, independent of transposition and tuning. The nearest key
// selects the controls that play it.
Events events::note_hz(const PlayCall& call) {
  constexpr double highest_key = 127.0;
  const double velocity = velocity_of(call, 2);
  if (velocity <= 0.0) {
    return note_end(call);
  }
  const double hz = call.arguments[1];
  const double key = 69.0 + 12.0 * std::log2(hz / usual_a4_hz) - call.instrument.transpose;
  return on_channel(
      call, 0,
      {.kind = EventKind::note_on,
       .index = static_cast<std::uint16_t>(std::lround(std::clamp(key, 0.0, highest_key))),
       .value = velocity,
       .value2 = hz});
}

// Uses the controller that ends all notes of a channel, because an ID's channel has no others.
Events events::note_end(const PlayCall& call) {
  constexpr std::uint16_t all_notes_off = 123;
  return on_channel(call, 0, {.kind = EventKind::controller, .index = all_notes_off});
}

Events events::note_bend(const PlayCall& call) {
  return on_channel(call, 0,
                    {.kind = EventKind::bend, .value = call.arguments[1] / note_bend_semitones});
}

Events events::note_pressure(const PlayCall& call) {
  return on_channel(call, 0, {.kind = EventKind::pressure, .value = call.arguments[1] / 127.0});
}

Events events::note_slide(const PlayCall& call) {
  constexpr std::uint16_t slide = 74;
  return on_channel(
      call, 0, {.kind = EventKind::controller, .index = slide, .value = call.arguments[1] / 127.0});
}

}  // namespace ressort::control
