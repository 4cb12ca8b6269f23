#include "core/engine/gestures.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

bool is_of_key(const Control& control, int key) {
  return control.source == Source::note && key >= control.lowest_key && key <= control.highest_key;
}

}  // namespace

Gestures::Gestures(const Machine& machine, const Playing& playing, Voices& voices,
                   Parameters& parameters)
    : machine_(machine),
      playing_(playing),
      voices_(voices),
      parameters_(parameters),
      drivers_(voices.size() * machine.inputs.size()) {
  for (const ModelInput& input : machine.inputs) {
    starts_.push_back(input.position);
  }
  for (const Control& control : playing.controls) {
    if (const auto start = row_of(control.gesture).start) {
      starts_[control.target] = start(stroke_on(control.target, &control));
    }
  }
}

void Gestures::go_on_from(const Gestures& from) {
  drivers_ = from.drivers_;
  starts_ = from.starts_;
}

void Gestures::place(std::size_t lane) {
  for (std::size_t input = 0; input < starts_.size(); ++input) {
    driver(lane, input).place(starts_[input]);
  }
}

void Gestures::wake(std::size_t lane) {
  if (voices_.wake(lane)) {
    place(lane);
  }
}

bool Gestures::is_moving(std::size_t lane) const {
  for (std::size_t input = 0; input < starts_.size(); ++input) {
    if (is_moving(lane, input)) {
      return true;
    }
  }
  return false;
}

Stroke Gestures::stroke_on(std::size_t input, const Control* control) const {
  Stroke stroke{.is_force = machine_.inputs[input].is_force,
                .middle = machine_.inputs[input].position,
                .rate_ratio = machine_.rate_ratio,
                .rate_hz = machine_.rate_hz,
                .bare = playing_.bare};
  if (control != nullptr) {
    stroke.has_control = true;
    stroke.low = control->low;
    stroke.high = control->high;
    stroke.exponential = control->exponential;
    stroke.travel = control->travel;
  }
  return stroke;
}

void Gestures::play(const GestureRow& gesture, std::size_t input, Stroke stroke) {
  const std::size_t last = voices_.last();
  if (gesture.goal != nullptr) {
    starts_[input] = gesture.goal(stroke);
    for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
      if (voices_[lane].awake || lane == last) {
        wake(lane);
        driver(lane, input).follow(starts_[input], stroke.pole_of_position());
      }
    }
    return;
  }
  wake(last);
  stroke.pitch = std::sqrt(voices_.factor_of(last, parameters_.highest_factor()));
  gesture.play(driver(last, input), stroke);
  starts_[input] = stroke.rest.value_or(starts_[input]);
  if (stroke.pressure) {
    press(*stroke.pressure);
  }
}

void Gestures::perform(const Control& control, double amount) {
  if (control.gesture == Gesture::parameter) {
    const Stroke turn{.amount = amount,
                      .has_control = true,
                      .low = control.low,
                      .high = control.high,
                      .exponential = control.exponential};
    return parameters_.set(control.target, turn.mapped());
  }
  Stroke stroke = stroke_on(control.target, &control);
  stroke.amount = amount;
  play(row_of(control.gesture), control.target, stroke);
}

template <class Wanted>
void Gestures::perform_all(double amount, Wanted&& wanted) {
  for (const Control& control : playing_.controls) {
    if (wanted(control)) {
      perform(control, amount);
    }
  }
}

void Gestures::press_key(int key, double velocity) {
  perform_all(velocity, [&](const Control& control) { return is_of_key(control, key); });
}

void Gestures::turn_controller(int number, double amount) {
  perform_all(amount, [&](const Control& control) {
    return control.source == Source::controller && control.number == number;
  });
}

void Gestures::press(double amount) {
  perform_all(amount, [](const Control& control) { return control.source == Source::pressure; });
}

void Gestures::perform_control(std::size_t row, double amount) {
  if (row < playing_.controls.size()) {
    perform(playing_.controls[row], amount);
  }
}

void Gestures::perform_live(const Event& event) {
  const GestureRow& gesture = row_of(event.gesture);
  const auto say = [&](std::size_t input, const Control* control) {
    Stroke stroke = stroke_on(input, control);
    stroke.is_live = true;
    stroke.amount = event.value;
    stroke.second = event.value2;
    play(gesture, input, stroke);
  };
  if (gesture.live == Live::by_preset) {
    const auto control =
        std::find_if(playing_.controls.begin(), playing_.controls.end(), [&](const Control& row) {
          return row.gesture == event.gesture && machine_.inputs[row.target].number == event.index;
        });
    if (control != playing_.controls.end()) {
      say(control->target, &*control);
    }
  } else if (gesture.live != Live::never) {
    for (std::size_t i = 0; i < machine_.inputs.size(); ++i) {
      if (machine_.inputs[i].number == event.index &&
          machine_.inputs[i].is_force == (gesture.live == Live::on_forces)) {
        say(i, nullptr);
      }
    }
  }
}

void Gestures::release(std::size_t lane) {
  for (const Control& control : playing_.controls) {
    const auto release = row_of(control.gesture).release;
    if (release != nullptr && is_of_key(control, voices_[lane].key)) {
      release(driver(lane, control.target), stroke_on(control.target, &control));
    }
  }
}

// Drivers that rest give every frame the same row.
template <class T>
void Gestures::fill_rest(Bank<T>& bank, const PartBank<T>& part, std::size_t first,
                         std::size_t frames) {
  const std::size_t width = part.width;
  const std::size_t step = part.program.inputs.size() * width;
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    for (std::size_t k = 0; k < width; ++k) {
      bank.row[i * width + k] =
          first + k < voices_.size()
              ? static_cast<T>(driver(first + k, part.program.inputs[i].input).value())
              : T(0);
    }
  }
  if (bank.still < frames * step) {
    std::fill_n(bank.velocity.begin(), frames * step, T(0));
    bank.still = frames * step;
  }
  const auto end = bank.row.begin() + static_cast<std::ptrdiff_t>(step);
  if (bank.filled_part == &part && bank.filled_frames >= frames &&
      std::equal(bank.row.begin(), end, bank.filled.begin())) {
    return;
  }
  bank.mixer.fill_rows(bank.row.data(), step, frames, bank.value.data());
  std::copy(bank.row.begin(), end, bank.filled.begin());
  bank.filled_part = &part;
  bank.filled_frames = frames;
}

template <class T>
void Gestures::fill(Bank<T>& bank, std::size_t p, std::size_t first, std::size_t frames,
                    EnergyWatch& watch) {
  const PartBank<T>& part = bank.parts[p];
  fill_rest(bank, part, first, frames);
  const std::size_t step = part.program.inputs.size() * part.width;  // from frame to frame
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    const InputSlot& slot = part.program.inputs[i];
    for (std::size_t lane = first; lane < voices_.pack_end(first, part.width); ++lane) {
      InputDriver& mover = driver(lane, slot.input);
      if (!voices_[lane].awake || !mover.is_moving()) {
        continue;
      }
      watch.stir(voices_[lane], lane, p);
      bank.filled_part = nullptr;
      T* value = bank.value.data() + i * part.width + lane - first;
      T* velocity = bank.velocity.data() + i * part.width + lane - first;
      if (slot.is_force) {
        for (std::size_t n = 0; n < frames; ++n) {
          value[n * step] = static_cast<T>(mover.next_force().value);
        }
      } else {
        bank.still = 0;
        mover.fill_positions(frames, step, value, velocity);
      }
    }
  }
}

template void Gestures::fill(Bank<float>&, std::size_t, std::size_t, std::size_t, EnergyWatch&);
template void Gestures::fill(Bank<double>&, std::size_t, std::size_t, std::size_t, EnergyWatch&);

}  // namespace ressort
