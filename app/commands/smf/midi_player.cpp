#include "app/commands/smf/midi_player.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/midi_number.h"

namespace ressort::commands {
namespace {

constexpr std::uint8_t controller = 0xb0;

// Returns what a message sets, such as a controller of a channel, or nothing for a key.
std::optional<std::pair<int, int>> what_it_sets(std::span<const std::uint8_t> bytes) {
  const int kind = bytes[0] & 0xf0;
  const bool is_controller = kind == controller && bytes.size() > 1;
  const bool sets = kind == 0xc0 || kind == 0xd0 || kind == 0xe0 ||
                    (is_controller && bytes[1] < MidiNumber::all_sound_off);
  return sets ? std::optional(std::pair<int, int>(bytes[0], is_controller ? bytes[1] : 0))
              : std::nullopt;
}

}  // namespace

MidiPlayer::MidiPlayer(MidiFile file, MidiSink& door, Song& song)
    : file_(std::move(file)), door_(door), song_(song) {
  thread_ = std::thread([this] { work(); });
}

MidiPlayer::~MidiPlayer() {
  must_end_.raise();
  song_.wake();
  thread_.join();
}

void MidiPlayer::send(std::span<const std::uint8_t> bytes, Song::Clock::time_point time) {
  door_.arrive(
      reader_, bytes,
      std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count());
}

// Releases the keys and pedals of all channels that the file uses.
void MidiPlayer::release_keys(Song::Clock::time_point time) {
  using enum MidiNumber::Controller;
  std::set<std::uint8_t> channels;
  for (const MidiFile::Message& message : file_.messages) {
    const std::uint8_t status = file_.bytes_of(message)[0];
    if (status < 0xf0) {
      channels.insert(status & 0x0f);
    }
  }
  for (const std::uint8_t channel : channels) {
    for (const int number : {sustain_pedal, sostenuto_pedal, all_notes_off}) {
      send(std::array<std::uint8_t, 3>{static_cast<std::uint8_t>(controller | channel),
                                       static_cast<std::uint8_t>(number), 0},
           time);
    }
  }
}

// Sends the last value of everything that the messages before a position set, in their order.
// Returns the first message from there on.
std::size_t MidiPlayer::go_to(double position_s, Song::Clock::time_point time) {
  const auto next = std::ranges::partition_point(
      file_.messages,
      [&](const MidiFile::Message& message) { return message.time_s < position_s; });
  std::map<std::pair<int, int>, std::size_t> newest;
  const auto count = static_cast<std::size_t>(next - file_.messages.begin());
  for (std::size_t i = 0; i < count; ++i) {
    if (const auto set = what_it_sets(file_.bytes_of(file_.messages[i]))) {
      newest[*set] = i;
    }
  }
  std::set<std::size_t> in_order;
  for (const auto& [set, i] : newest) {
    in_order.insert(i);
  }
  for (const std::size_t i : in_order) {
    send(file_.bytes_of(file_.messages[i]), time);
  }
  return count;
}

// Stamps messages with their nominal times instead of the times at which this thread wakes up. The
// output has no jitter as long as the thread wakes up within a period.
void MidiPlayer::work() {
  std::size_t next = 0;
  std::uint64_t jumps = 0;
  while (!must_end_.is_raised()) {
    const Song::State state = song_.state();
    if (state.jumps != jumps) {
      jumps = state.jumps;
      release_keys(state.at);
      next = state.plays ? go_to(state.at_s, state.at) : next;
    }
    const bool loops = state.loop_to_s > state.loop_from_s && state.at_s < state.loop_to_s;
    const bool is_at_end = next == file_.messages.size();
    if (!state.plays) {
      song_.wait(state);
    } else if (loops && (is_at_end || file_.messages[next].time_s >= state.loop_to_s)) {
      if (song_.wait_until(state.time_of(state.loop_to_s), state)) {
        song_.go_back(state);
      }
    } else if (is_at_end) {
      song_.end(state);
    } else if (const auto time = state.time_of(file_.messages[next].time_s);
               song_.wait_until(time, state)) {
      send(file_.bytes_of(file_.messages[next]), time);
      ++next;
    }
  }
}

}  // namespace ressort::commands
