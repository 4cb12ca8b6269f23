// core: the ways to play an input. A gesture is one row of `gestures`: its name, its arguments in a
// preset and in a live call, and its effect on the input's driver. Presets, the engine, OSC, the
// console, scores, stability checks and documents read these rows. No other file names a gesture.
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
#include "core/stroke.h"

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
  noise,
  parameter
};

// An argument of a live call: a number or a text.
struct CallArgument {
  std::string_view word = {};     // placeholder in help texts
  std::string_view meaning = {};  // name in errors: "the strength must lie between 0 and 1"
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  std::optional<double> otherwise = {};      // default; nullopt: the argument is required
  std::optional<double> console_value = {};  // default at the console
  std::string_view unit = {};
  bool is_text = false;
  bool is_whole = false;  // an integer: a key, a controller, an ID
};

enum class Live : std::uint8_t {
  never,
  on_positions,  // /in/N/NAME plays every position input, whatever the preset says
  on_forces,     // /in/N/NAME plays every force input
  by_preset,     // /in/N/NAME plays an input for which the preset has a control of this gesture
};

struct GestureRow {
  Gesture gesture;
  std::string_view name;  // `how` in a preset, /in/N/NAME
  // Presets.
  std::string_view does = {};          // effect on the input; empty: a preset cannot use it
  bool needs_position = false;         // cannot play a force input
  std::string_view needs_travel = {};  // meaning of `travel` if it must be above 0; else empty
  bool is_blow = false;                // its range is the size of a blow, not of a lasting force
  bool is_touch = false;               // it excites nothing, so it does not wake a sleeping voice
  // Returns the position at which a new voice's driver starts; null: the input's own.
  double (*start)(const Stroke& control) = nullptr;
  // Returns the position to which it drives the input in all voices, new ones too. [audio]
  double (*goal)(const Stroke& stroke) = nullptr;
  // Without a goal: plays the voice that was played last, and ends when its key is released.
  // [audio] wait-free
  void (*play)(InputDriver& driver, Stroke& stroke) = nullptr;
  void (*release)(InputDriver& driver, const Stroke& stroke) = nullptr;
  // Live calls: /in/N/NAME and the console's command of this name.
  Live live = Live::never;
  CallArgument arguments[2] = {};
  std::string_view live_does = {};
  std::string_view command = {};  // arguments of the console's command; empty: there is none
  std::string_view command_does = {};
  std::string_view command_details = {};
};

inline constexpr GestureRow gestures[] = {
    {.gesture = Gesture::position,
     .name = "position",
     .does = "moves to the given position, smoothed",
     .goal = [](const Stroke& stroke) { return stroke.mapped(); },
     .live = Live::on_positions,
     .arguments = {{"POSITION", "the position"}},
     .live_does = "moves input N to a position, smoothed"},
    {.gesture = Gesture::force,
     .name = "force",
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           // A force of zero duration is an impulse. Both are scaled so that the motion does not
           // depend on the sample rate.
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
     .live_does = "pushes input N for one sample, or for SECONDS"},
    {.gesture = Gesture::pluck,
     .name = "pluck",
     .does = "a finger sweeps across the string to the other side, at a speed from `range`; "
             "slower is louder",
     .needs_position = true,
     .needs_travel = "how far from the string the finger rests",
     .start = [](const Stroke& control) { return control.middle - control.settings.travel; },
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           const double travel = stroke.settings.travel;
           const double side = driver.target() > stroke.middle ? -travel : travel;
           stroke.rest = stroke.middle + side;
           driver.sweep(*stroke.rest, stroke.paced(stroke.mapped()));
         },
     .live = Live::by_preset,
     .arguments = {{.word = "STRENGTH",
                    .meaning = "the strength",
                    .least = 0.0,
                    .most = 1.0,
                    .console_value = 0.8}},
     .live_does = "sweeps the finger at input N across the string; strength 0-1",
     .command = "[INPUT] [STRENGTH]",
     .command_does = "plucks with the finger at an input",
     .command_details =
         "INPUT is the input's number; the default is the first one that can pluck. STRENGTH is 0\n"
         "to 1; the default is 0.8. 'explain' lists the inputs that can pluck."},
    {.gesture = Gesture::bow,
     .name = "bow",
     .does = "a bow moves at a speed from `range` while the key is held",
     .needs_position = true,
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           // Friction has no scale: if bow speed and output level grow together, the motion keeps
           // its shape. With a level, the live speed therefore sets the loudness alone.
           const double share = std::min(1.0, std::fabs(stroke.amount));
           if (stroke.is_live && stroke.settings.has_level) {
             stroke.loudness = share;
           }
           const bool is_full = stroke.settings.has_level && share > 0.0;
           const double live =
               std::copysign(stroke.settings.high * (is_full ? 1.0 : share), stroke.amount);
           driver.draw(stroke.paced(stroke.is_live ? live : stroke.mapped()),
                       stroke.pole_of_speed());
           if (stroke.settings.roughness > 0.0) {
             driver.roughen(stroke.settings.roughness, stroke.noise());
           }
           if (stroke.is_live && stroke.second >= 0.0) {
             stroke.pressure = stroke.second;
           }
         },
     .release = [](InputDriver& driver,
                   const Stroke& stroke) { driver.draw(0.0, stroke.pole_of_speed()); },
     .live = Live::by_preset,
     .arguments = {{"SPEED", "the speed", -1.0, 1.0},
                   {"PRESSURE", "the pressure", 0.0, 1.0, -1.0}},  // below 0: unchanged
     .live_does = "draws the bow at input N; speed -1 to 1, pressure 0-1; speed 0 stops",
     .command = "SPEED [PRESSURE] [INPUT]",
     .command_does = "draws the bow at an input; speed 0 stops",
     .command_details =
         "SPEED is -1 to 1. PRESSURE is 0 to 1; by default it does not change. INPUT is the "
         "input's\n"
         "number; the default is the first one that can bow. 'explain' lists the inputs that can\n"
         "bow."},
    {.gesture = Gesture::impulse,
     .name = "impulse",
     .does = "a blow: one sample of force, or a pulse of `length_ms`; of displacement if the "
             "input is a position",
     .is_blow = true,
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           driver.strike(stroke.struck(stroke.mapped()), stroke.pulse_frames());
         }},
    {.gesture = Gesture::swing,
     .name = "swing",
     .does = "a mallet rests `travel` away, swings in by `range` and back within `length_ms`; a "
             "negative `range` swings from above",
     .needs_position = true,
     .needs_travel = "how far from the string the mallet rests",
     .start =
         [](const Stroke& control) {
           return control.middle - std::copysign(control.settings.travel, control.settings.high);
         },
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           const double depth = stroke.mapped();
           const double frames = std::max(2.0, stroke.pulse_frames());
           const double way = depth + std::copysign(stroke.settings.travel, stroke.settings.high);
           driver.strike(0.5 * way * frames, frames);
         }},
    {.gesture = Gesture::hold,
     .name = "hold",
     .does = "moves to the second number of `range` while the key is held, then back to the first",
     .start = [](const Stroke& control) { return control.settings.low; },
     .play = [](InputDriver& driver,
                Stroke& stroke) { driver.follow(stroke.settings.high, stroke.pole_of_position()); },
     .release =
         [](InputDriver& driver, const Stroke& stroke) {
           driver.follow(stroke.settings.low, stroke.pole_of_position());
         }},
    {.gesture = Gesture::touch,
     .name = "touch",
     .does = "a finger rests off the string at the first number of `range`, and is laid on it up "
             "to the second",
     .needs_position = true,
     .is_touch = true,
     .start = [](const Stroke& control) { return control.settings.low; },
     .goal = [](const Stroke& stroke) { return stroke.mapped(); }},
    {.gesture = Gesture::noise,
     .name = "noise",
     .does = "a burst of noise in `band_hz`: its rms is from `range`, its T60 from `length_ms`; of "
             "displacement if the input is a position. Pitch does not change it",
     .is_blow = true,
     .play =
         [](InputDriver& driver, Stroke& stroke) {
           driver.rustle(stroke.pushed(stroke.mapped()), stroke.burst_kept(), stroke.noise());
         }},
    {.gesture = Gesture::parameter,
     .name = "parameter",
     .does = "no input: changes the parameter that `to` names"},
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
