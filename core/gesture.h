// core: the ways to play an input. A gesture is one row of `gestures`: its name, what a preset and
// a live call may ask of it, and what it does to the input's driver. Presets, the engine, OSC, the
// console, scores, stability checks and documents read these rows; nothing else knows a gesture.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <string_view>

#include "core/input_driver.h"

namespace ressort {

enum class Gesture : std::uint8_t {
  position,
  force,
  pluck,
  bow,
  impulse,
  swing,
  hold,
  touch,
  parameter
};

// One performance of a gesture: what is asked, and of which input of which voice.
struct Stroke {
  double amount = 1.0;  // 0..1 of a preset's source; of a live call its first argument
  double second = 0.0;  // of a live call
  bool is_live = false;
  // Of the preset's control; a live call without a control takes its amount as it is.
  bool has_control = false;
  double low = 0.0;
  double high = 1.0;
  bool exponential = false;
  double travel = 0.0;
  bool has_level = false;
  double low_db = 0.0;
  double high_db = 0.0;
  double longest_s = 0.0;
  double shortest_s = 0.0;
  // Of the input and the voice.
  bool is_force = false;
  double middle = 0.0;      // the input's position in the model; 0 of a force
  double rate_ratio = 1.0;  // 44 100 Hz to the engine's rate
  double rate_hz = 44100.0;
  double pitch = 1.0;  // of the voice, to that of the model as it is written
  bool bare = false;   // nothing is smoothed
  // Set by the gesture.
  std::optional<double> rest;      // where a new voice's driver starts from now on
  std::optional<double> pressure;  // what the channel is pressed with, too
  std::optional<double> loudness;  // a factor on its loudest level, if the amount does not say it

  double mapped() const {
    const double a = std::clamp(amount, 0.0, 1.0);
    return !has_control                      ? amount
           : exponential && low * high > 0.0 ? low * std::pow(high / low, a)
                                             : low + (high - low) * a;
  }
  // The voice's level, as a factor.
  double level() const {
    const double part = loudness ? 1.0 : std::clamp(amount, 0.0, 1.0);
    return std::pow(10.0, (low_db + (high_db - low_db) * part) / 20.0) * loudness.value_or(1.0);
  }
  // How long a blow lasts: from soft to hard in equal ratios; on a higher key as much shorter as
  // its periods are, so that all keys sound alike.
  double pulse_frames() const {
    const double a = std::clamp(amount, 0.0, 1.0);
    const double s = longest_s > 0.0 && shortest_s > 0.0
                         ? longest_s * std::pow(shortest_s / longest_s, a)
                         : longest_s + (shortest_s - longest_s) * a;
    return s * rate_hz / pitch;
  }
  // A speed or an impulse that gives the same displacement at every rate and pitch.
  double paced(double value) const { return value * rate_ratio * pitch; }
  // A blow's force, or the displacement that gives the same blow through a spring.
  double struck(double value) const {
    return is_force ? paced(value) : value / (rate_ratio * pitch);
  }
  // One-pole filters of a position, by (1 - pole) * rate in Hz, and of a speed, by its time.
  double pole_of_position() const { return bare ? 0.0 : 1.0 - std::min(1.0, 44.1 / rate_hz); }
  double pole_of_speed() const { return bare ? 0.0 : std::exp(-1.0 / (0.005 * rate_hz)); }
};

// An argument of what is said live: a number, or a text.
struct CallArgument {
  std::string_view word = {};     // as a person writes it
  std::string_view meaning = {};  // in an error: "the strength must lie between 0 and 1"
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  std::optional<double> otherwise = {};      // where it is left out; nothing: it must be there
  std::optional<double> console_value = {};  // the same at the console
  std::string_view unit = {};
  bool is_text = false;
  bool is_whole = false;  // nothing lies between two of them: a key, a controller, an ID
};

enum class Live : std::uint8_t {
  never,
  on_positions,  // /in/N/NAME plays every position input, whatever the preset says
  on_forces,     // the same of force inputs
  by_preset,     // /in/N/NAME plays an input for which the preset has a control of this gesture
};

enum class Extent : std::uint8_t {
  range,   // of positions (or forces): low..high of the control
  travel,  // of positions, on both sides of 0
  endless,
};

struct GestureRow {
  Gesture gesture;
  std::string_view name;  // `how` in a preset, /in/N/NAME
  // In a preset: what the input does; nothing where a preset cannot ask for it.
  std::string_view does = {};
  bool needs_position = false;         // cannot play a force input
  std::string_view needs_travel = {};  // why a control needs `travel` above 0; nothing: it does not
  // How far it drives an input, for checks of stability.
  Extent extent = Extent::range;
  bool is_blow = false;   // its range is the size of a blow, not of a lasting force
  bool is_sweep = false;  // its range is the speed at which it passes what it touches
  bool is_touch = false;  // it moves nothing by itself: who is silent stays so
  // Where a new voice's driver starts; null: in the middle.
  double (*start)(const Stroke& control) = nullptr;
  // Where it drives the input in all voices, new ones too. [audio]
  double (*goal)(const Stroke& stroke) = nullptr;
  // Without a goal: what it does in the voice that was played last, and when its key is released.
  // [audio] wait-free
  void (*play)(InputDriver& driver, Stroke& stroke) = nullptr;
  void (*release)(InputDriver& driver, const Stroke& stroke) = nullptr;
  // Live calls: /in/N/NAME and the console's command of this name.
  Live live = Live::never;
  CallArgument arguments[2] = {};
  std::string_view live_does = {};
  std::string_view command = {};  // the arguments of the console's command; nothing: there is none
  std::string_view command_does = {};
  std::string_view command_details = {};
};

inline constexpr GestureRow gestures[] = {
    {.gesture = Gesture::position,
     .name = "position",
     .does = "goes where it is told, smoothed",
     .goal = [](const Stroke& stroke) { return stroke.mapped(); },
     .live = Live::on_positions,
     .arguments = {{"POSITION", "the position"}},
     .live_does = "moves the hand at input N, smoothed"},
    {.gesture = Gesture::force,
     .name = "force",
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           // A force of no length is an impulse; its effect does not depend on the rate, nor does
           // that of a force that lasts.
           const double r = stroke.rate_ratio;
           const auto frames = static_cast<std::size_t>(
               std::llround(std::max(0.0, stroke.second) * stroke.rate_hz));
           if (frames == 0) {
             driver.strike(stroke.amount * r);
           } else {
             driver.push(stroke.amount * r * r, frames);
           }
         },
     .live = Live::on_forces,
     .arguments = {{"FORCE", "the force"},
                   {"SECONDS", "the time in seconds", 0.0, 3600.0, 0.0, {}, "s"}},
     .live_does = "pushes input N: one sample, or as long as told"},
    {.gesture = Gesture::pluck,
     .name = "pluck",
     .does = "a finger sweeps from one side of the string to the other, at a speed from `range`; "
             "the slower, the louder",
     .needs_position = true,
     .needs_travel = "how far from the string the finger rests",
     .extent = Extent::travel,
     .is_sweep = true,
     .start = [](const Stroke& control) { return control.middle - control.travel; },
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           const double side = driver.target() > stroke.middle ? -stroke.travel : stroke.travel;
           stroke.rest = stroke.middle + side;
           driver.sweep(*stroke.rest, stroke.paced(stroke.mapped()));
         },
     .live = Live::by_preset,
     .arguments = {{.word = "STRENGTH",
                    .meaning = "the strength",
                    .least = 0.0,
                    .most = 1.0,
                    .console_value = 0.8}},
     .live_does = "the finger at input N sweeps through the string; 0-1",
     .command = "[INPUT] [STRENGTH]",
     .command_does = "plucks with the finger at an input",
     .command_details =
         "INPUT is its number, or the first that can pluck; STRENGTH is 0 to 1, or 0.8. 'explain'\n"
         "tells which inputs know a pluck."},
    {.gesture = Gesture::bow,
     .name = "bow",
     .does = "a bow moves at a speed from `range` as long as the key is held",
     .needs_position = true,
     .extent = Extent::endless,
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           // Friction knows no size: a bow whose speed and scale grow together moves the string so
           // much more, and in no other way. So where there is a level, live speed is that.
           const double share = std::min(1.0, std::fabs(stroke.amount));
           if (stroke.is_live && stroke.has_level) {
             stroke.loudness = share;
           }
           const double live = std::copysign(
               stroke.high * (stroke.has_level && share > 0.0 ? 1.0 : share), stroke.amount);
           driver.draw(stroke.paced(stroke.is_live ? live : stroke.mapped()),
                       stroke.pole_of_speed());
           if (stroke.is_live && stroke.second >= 0.0) {
             stroke.pressure = stroke.second;
           }
         },
     .release = [](InputDriver& driver,
                   const Stroke& stroke) { driver.draw(0.0, stroke.pole_of_speed()); },
     .live = Live::by_preset,
     .arguments = {{"SPEED", "the speed", -1.0, 1.0},
                   {"PRESSURE", "the pressure", 0.0, 1.0, -1.0}},  // below 0: as it was
     .live_does = "draws the bow at input N; speed -1 to 1, pressure 0-1; speed 0 stops",
     .command = "SPEED [PRESSURE] [INPUT]",
     .command_does = "draws the bow at an input; speed 0 stops",
     .command_details = "SPEED is -1 to 1, PRESSURE is 0 to 1, or as it was; INPUT is its number, "
                        "or the first that\n"
                        "can bow. 'explain' tells which inputs know a bow."},
    {.gesture = Gesture::impulse,
     .name = "impulse",
     .does = "a blow: one sample of force, or a pulse as long as `length_ms` says; of displacement "
             "where the input is a position",
     .is_blow = true,
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           driver.strike(stroke.struck(stroke.mapped()), stroke.pulse_frames());
         }},
    {.gesture = Gesture::swing,
     .name = "swing",
     .does = "a mallet: rests `travel` away, swings in as far as `range` says, and back, in "
             "`length_ms`; `range` below 0: from above",
     .needs_position = true,
     .needs_travel = "how far from the string the mallet rests",
     .start =
         [](const Stroke& control) {
           return control.middle - std::copysign(control.travel, control.high);
         },
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           const double depth = stroke.mapped();
           const double frames = std::max(2.0, stroke.pulse_frames());
           const double way = depth + std::copysign(stroke.travel, stroke.high);
           driver.strike(0.5 * way * frames, frames);
         }},
    {.gesture = Gesture::hold,
     .name = "hold",
     .does = "goes to the second number of `range` while the key is held, and back to the first",
     .start = [](const Stroke& control) { return control.low; },
     .play = [](InputDriver& driver,
                Stroke& stroke) { driver.follow(stroke.high, stroke.pole_of_position()); },
     .release = [](InputDriver& driver,
                   const Stroke& stroke) { driver.follow(stroke.low, stroke.pole_of_position()); }},
    {.gesture = Gesture::touch,
     .name = "touch",
     .does = "a finger: off the string at the first number of `range`, where it rests, and laid on "
             "as far as the second",
     .needs_position = true,
     .is_touch = true,
     .start = [](const Stroke& control) { return control.low; },
     .goal = [](const Stroke& stroke) { return stroke.mapped(); }},
    // No driver: the parameter that `to` names is turned.
    {.gesture = Gesture::parameter,
     .name = "parameter",
     .does = "no input: the parameter that `to` names is turned"},
};

constexpr const GestureRow& row_of(Gesture gesture) {
  return gestures[static_cast<std::size_t>(gesture)];
}

static_assert([] {
  for (std::size_t i = 0; i < std::size(gestures); ++i) {
    if (static_cast<std::size_t>(gestures[i].gesture) != i) {
      return false;
    }
  }
  return true;
}());

}  // namespace ressort
