// core/engine: the gestures: what drives the inputs of every voice, and what the preset's controls
// and live calls make of it.
#pragma once

#include <cstddef>
#include <vector>

#include "core/engine/energy_watch.h"
#include "core/engine/event.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/parameters.h"
#include "core/engine/voices.h"
#include "core/gesture.h"

namespace ressort {

// A gesture wakes the voices that it plays, and may turn parameters. All functions but the
// constructor: [audio] wait-free.
class Gestures {
 public:
  Gestures(const Machine& machine, const Playing& playing, Voices& voices, Parameters& parameters);
  void go_on_from(const Gestures& from);

  // The drivers of a voice that starts: to where gestures begin.
  void place(std::size_t lane);
  // A voice that slept starts.
  void wake(std::size_t lane);
  bool is_moving(std::size_t lane, std::size_t input) const {
    return drivers_[lane * machine_.inputs.size() + input].is_moving();
  }
  bool is_moving(std::size_t lane) const;

  // What the controls of this source do in the voice that was played last; 0..1. O(controls)
  void press_key(int key, double velocity);
  void turn_controller(int number, double amount);
  void press(double amount);
  void perform_control(std::size_t row, double amount);
  // Of EventKind::gesture.
  void perform_live(const Event& event);
  // What a key does when it is released, in its voice.
  void release(std::size_t lane);

  // Where the drivers of part `p`, of the kernel that begins with voice `first`, are in each frame.
  template <class T>
  void fill(Bank<T>& bank, std::size_t p, std::size_t first, std::size_t frames,
            EnergyWatch& watch);

 private:
  InputDriver& driver(std::size_t lane, std::size_t input) {
    return drivers_[lane * machine_.inputs.size() + input];
  }
  template <class Wanted>
  void perform_all(double amount, Wanted&& wanted);
  void perform(const Control& control, double amount);
  // What a gesture is to know of an input and of the control that asks for it, if one does.
  Stroke stroke_on(std::size_t input, const Control* control) const;
  // In the voice that was played last, or in all.
  void play(const GestureRow& gesture, std::size_t input, Stroke stroke);
  template <class T>
  void fill_rest(Bank<T>& bank, const PartBank<T>& part, std::size_t first, std::size_t frames);

  const Machine& machine_;
  const Playing& playing_;
  Voices& voices_;
  Parameters& parameters_;
  std::vector<InputDriver> drivers_;  // [lane][input]
  std::vector<double> starts_;        // [input] where a new voice's driver is
};

}  // namespace ressort
