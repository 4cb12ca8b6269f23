// app/realtime: maps controllers to parameters, controls and actions, on the audio thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "app/rooms.h"
#include "core/controller.h"
#include "core/engine/engine.h"
#include "core/knob_range.h"

namespace ressort::realtime {

// The target of a controller, as the playing model has it.
struct MappedTarget {
  // parameter, custom, controller, panic, or program for an action of the worker.
  EventKind kind = EventKind::controller;
  bool exists = false;          // false: the controller keeps its usual function
  bool has_parameter = false;   // a controller or custom event moves `parameter`
  std::uint16_t index = 0;      // index of the event, or the row of an action
  std::uint16_t parameter = 0;  // the parameter that shows the present value
  std::uint32_t model = 0;      // serial of the model of `index` and `parameter`; 0: any model
  double start = 0.0;           // present position, if no parameter shows it
  KnobRange range;              // of the parameter
};

struct MappedController {
  ControllerInput input;
  MappedTarget target;
};

// The whole mapping: plain data, which the session makes anew for each model.
struct ControllerMap {
  static constexpr std::size_t most_rows = 256;
  std::array<MappedController, most_rows> rows{};
  std::size_t count = 0;
};

// A MIDI message to a controller.
using MidiBytes = std::array<std::uint8_t, 3>;

// All functions: [audio] wait-free, O(rows) for each event.
class ControllerMapper {
 public:
  enum class Result : std::uint8_t {
    passes,  // the event is not mapped
    mapped,  // the event has become the target's
    action,  // the worker is to do the action of the row Event::index
    nothing  // the event acts later or not at all, as a knob that has not met the present value
  };

  // Replaces the mapping, which must live until the next call.
  void use(const ControllerMap& map);
  // Sets the engine whose parameters have the present values; null: none. Before the events of
  // every chunk, and before messages().
  void begin_chunk(const Engine* engine, std::uint32_t model);
  Result map(Event& event);
  // Follows an event of any source that moves a target.
  void follow(const Event& event);
  // Returns messages for the rows with `sends` whose values have changed, valid until the next
  // call. After every block.
  std::span<const MidiBytes> messages();

 private:
  struct State {
    double position = 0.0;   // present value of the target, 0..1
    bool is_newer = false;   // `position` is newer than the engine's value
    bool has_moved = false;  // `knob` is known
    double knob = 0.0;       // last value of the knob
    double set = -1.0;       // position that the knob has set last; below 0: none
    int sent = -1;           // number that was sent or received last; -1: none
  };
  // The parameter number that a channel has selected, and its data.
  struct Number {
    static constexpr int none = 0x3fff;
    int selected = none;
    int data = 0;
  };
  struct Move {
    std::size_t row = 0;
    double value = 0.0;
    double change = 0.0;  // of a relative controller, in place of `value`
    bool is_relative = false;
    bool is_note_on = false;
  };

  Result read(const Event& event, Move& move);
  Result read_number(const Event& event, Move& move);
  void read_value(int value, Move& move) const;
  bool find(const ControllerInput& source, bool is_low_half, std::size_t& row) const;
  bool exists(const MappedTarget& target) const;
  bool is_press(const Move& move);
  bool meets(const Move& move, double present);
  double position(std::size_t row) const;
  void add_messages(const ControllerInput& input, int number);

  const ControllerMap* map_ = nullptr;
  const Engine* engine_ = nullptr;
  std::uint32_t model_ = 0;
  std::array<State, ControllerMap::most_rows> states_{};
  std::array<Number, 16> numbers_{};  // [channel]
  std::array<int, 32> coarse_{};      // [controller] high half of a value of 14 bits
  std::array<MidiBytes, 4 * ControllerMap::most_rows> messages_{};
  std::size_t message_count_ = 0;
};

}  // namespace ressort::realtime
