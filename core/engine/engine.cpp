#include "core/engine/engine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <variant>

#include "core/engine/bank.h"
#include "core/engine/gesture.h"

namespace ressort {
namespace {

constexpr std::size_t ramp_frames = 128;  // of a parameter; a shorter ramp is heard as a click
constexpr double smoothing_hz = 44.1;     // of a position: its one-pole's (1 - pole) * rate
constexpr double bow_start_s = 0.005;     // a bow reaches its speed as a one-pole of this time
constexpr double steal_fade_s = 0.005;    // a voice that gives way takes this long to vanish
constexpr double level_memory_s = 0.1;    // how long a voice's level remembers a peak
constexpr double quiet_level = 1e-5;      // -100 dBFS
constexpr double quiet_s = 0.5;           // longer than half a period of the slowest sound
constexpr double bend_semitones = 2.0;
constexpr std::size_t most_reserve_lanes = 4;

struct Voice {
  bool awake = false;      // steps and is heard
  bool fading = false;     // gives way; its lane is free when the fade ends
  bool held = false;       // by a key
  bool sustained = false;  // by the pedal, its key being up
  std::uint8_t key = 0;
  std::uint8_t channel = 0;
  std::uint64_t born = 0;
  double frequency_hz = 0.0;  // without bend; 0: as the model is written
  double factor = 1.0;        // on every stiffness
  double gain = 1.0;
  double gain_step = 0.0;  // per sample
  double peak = 0.0;       // of the network's output since the last settling
  double level = 0.0;      // peak of the output, slowly forgotten
  std::size_t quiet_frames = 0;
};

}  // namespace

struct Engine::Voices {
  Voices(Program program_in, Playing playing_in, Precision precision)
      : program(std::move(program_in)),
        playing(std::move(playing_in)),
        bank(precision == Precision::float32
                 ? decltype(bank)(std::in_place_type<Bank<float>>, program, lanes_wanted())
                 : decltype(bank)(std::in_place_type<Bank<double>>, program, lanes_wanted())),
        voices(std::visit([](const auto& b) { return b.lanes(); }, bank)),
        hands(voices.size() * program.inputs.size()),
        parameters(program.parameters),
        rest(program.inputs.size()),
        audio_control(program.inputs.size(), nullptr),
        audio_before(program.inputs.size()),
        pole(playing.bare ? 0.0 : 1.0 - std::min(1.0, smoothing_hz / program.rate_hz)),
        bow_pole(playing.bare ? 0.0 : std::exp(-1.0 / (bow_start_s * program.rate_hz))) {
    for (std::size_t i = 0; i < rest.size(); ++i) {
      rest[i] = middle(i);
    }
    for (const Control& control : playing.controls) {
      if (control.gesture == Gesture::pluck) {
        rest[control.target] = middle(control.target) - control.travel;
      }
      if (control.gesture == Gesture::hold) {
        rest[control.target] = control.low;
      }
      if (control.source == Source::audio) {
        audio_control[control.target] = &control;
        audio_before[control.target] = middle(control.target);
      }
    }
    changes.reserve(max_changes);
    told.reserve(max_changes);
    start(0, 0.0);
    voices[0].level = 0.0;  // no note: the first one may take its place
  }

  std::size_t lanes_wanted() const {
    const auto wanted = static_cast<std::size_t>(std::max(1, playing.voices));
    return wanted + std::min(wanted, most_reserve_lanes);
  }

  // --- inputs ---------------------------------------------------------------------------------

  double middle(std::size_t input) const {
    const InputSlot& slot = program.inputs[input];
    return slot.is_force ? 0.0 : program.position[slot.node];
  }

  Hand& hand(std::size_t lane, std::size_t input) {
    return hands[lane * program.inputs.size() + input];
  }

  double mapped(const Control& control, double amount) const {
    const double a = std::clamp(amount, 0.0, 1.0);
    return control.exponential && control.low > 0.0 && control.high > 0.0
               ? control.low * std::pow(control.high / control.low, a)
               : control.low + (control.high - control.low) * a;
  }

  // A speed or an impulse that gives the same displacement at every rate and pitch.
  double paced(double amount, std::size_t lane) const {
    return amount * program.rate_ratio * std::sqrt(voices[lane].factor);
  }

  void move_to(std::size_t input, double position) {
    rest[input] = position;
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].awake || lane == last) {
        wake(lane);
        hand(lane, input).follow(position, pole);
      }
    }
  }

  void pluck(std::size_t lane, const Control& control, double strength) {
    Hand& finger = hand(lane, control.target);
    const double centre = middle(control.target);
    const double side = finger.target() > centre ? -control.travel : control.travel;
    finger.sweep(centre + side, paced(mapped(control, strength), lane));
    rest[control.target] = centre + side;
  }

  void perform(const Control& control, std::size_t lane, double amount) {
    switch (control.gesture) {
      case Gesture::parameter:
        set_parameter(control.target, mapped(control, amount));
        break;
      case Gesture::position:
        move_to(control.target, mapped(control, amount));
        break;
      case Gesture::pluck:
        wake(lane);
        pluck(lane, control, amount);
        break;
      case Gesture::bow:
        wake(lane);
        hand(lane, control.target).draw(paced(mapped(control, amount), lane), bow_pole);
        break;
      case Gesture::impulse:
        wake(lane);
        hand(lane, control.target).strike(paced(mapped(control, amount), lane));
        break;
      case Gesture::hold:
        wake(lane);
        hand(lane, control.target).follow(control.high, pole);
        break;
    }
  }

  template <class Wanted>
  void perform_all(std::size_t lane, double amount, Wanted&& wanted) {
    for (const Control& control : playing.controls) {
      if (wanted(control)) {
        perform(control, lane, amount);
      }
    }
  }

  // --- parameters -----------------------------------------------------------------------------

  void set_parameter(std::size_t index, double value) {
    if (index >= parameters.size() || parameters[index] == value) {
      return;
    }
    parameters[index] = value;
    note_change(static_cast<std::uint16_t>(index));
    for (const std::uint32_t c : program.depending[index]) {
      for (std::size_t lane = 0; lane < voices.size(); ++lane) {
        if (voices[lane].awake) {
          set_coefficient(lane, c, !playing.bare);
        }
      }
    }
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      std::visit([&](auto& b) { b.ramp(lane, ramp_frames); }, bank);
    }
  }

  void note_change(std::uint16_t index) {
    if (changes.size() < max_changes &&
        std::find(changes.begin(), changes.end(), index) == changes.end()) {
      changes.push_back(index);
    }
  }

  void set_coefficient(std::size_t lane, std::uint32_t c, bool ramped) {
    const double value =
        coefficient_value(program, program.coefficients[c], parameters, voices[lane].factor);
    std::visit([&](auto& b) { b.set_coefficient(lane, c, value, ramped); }, bank);
  }

  void tune(std::size_t lane, bool ramped) {
    Voice& voice = voices[lane];
    const double bent = std::exp2(bend * bend_semitones / 12.0);
    const double factor = voice.frequency_hz > 0.0
                              ? stiffness_factor(playing.mode_stiffness, playing.mode_damping,
                                                 voice.frequency_hz * bent, program.rate_hz)
                              : bent * bent;
    voice.factor = std::min(factor, std::max(1.0, playing.highest_factor));
    for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
      set_coefficient(lane, c, ramped);
    }
    if (ramped) {
      std::visit([&](auto& b) { b.ramp(lane, ramp_frames); }, bank);
    }
  }

  // --- voices ---------------------------------------------------------------------------------

  void start(std::size_t lane, double frequency_hz) {
    Voice& voice = voices[lane];
    voice = Voice{};
    voice.awake = true;
    voice.frequency_hz = frequency_hz;
    voice.born = ++births;
    voice.level = 1.0;  // not yet heard: not yet the quietest
    rest_lane(lane);
    tune(lane, false);
    last = lane;
  }

  void rest_lane(std::size_t lane) {
    std::visit(
        [&](auto& b) {
          const std::size_t width = b.lanes() / b.groups.size();
          reset_lane(program, b.groups[lane / width], lane % width);
        },
        bank);
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      hand(lane, i).place(rest[i]);
    }
  }

  void wake(std::size_t lane) {
    if (!voices[lane].awake) {
      start(lane, voices[lane].frequency_hz);
    }
    voices[lane].quiet_frames = 0;
  }

  void fade(std::size_t lane, double seconds) {
    Voice& voice = voices[lane];
    const double step = -1.0 / std::max(1.0, seconds * program.rate_hz);
    voice.gain_step = std::min(voice.gain_step, step);
    voice.fading = true;
    voice.held = voice.sustained = false;
  }

  bool is_live(std::size_t lane) const { return voices[lane].awake && !voices[lane].fading; }

  // A lane for a new note: the same key's, a free one, or the quietest's place.
  std::size_t lane_for(int key, int channel) {
    std::size_t live = 0;
    std::size_t quietest = voices.size();
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (!is_live(lane)) {
        continue;
      }
      ++live;
      if (quietest == voices.size() || voices[lane].level < voices[quietest].level) {
        quietest = lane;
      }
    }
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      const Voice& voice = voices[lane];
      if (is_live(lane) && voice.frequency_hz > 0.0 && voice.key == key &&
          voice.channel == channel) {
        return lane;
      }
    }
    if (live >= static_cast<std::size_t>(std::max(1, playing.voices))) {
      stolen += voices[quietest].level > quiet_level ? 1 : 0;
      fade(quietest, steal_fade_s);
    }
    // A reserve lane is free unless several voices were stolen within one fade; then the one
    // that has faded most goes at once.
    std::size_t faintest = voices.size();
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (!voices[lane].awake) {
        return lane;
      }
      if (voices[lane].fading &&
          (faintest == voices.size() || voices[lane].gain < voices[faintest].gain)) {
        faintest = lane;
      }
    }
    return faintest;
  }

  void note_on(const Event& event) {
    const int key = event.index;
    if (playing.tuning == Tuning::fixed) {
      // One instrument as it is written: a key is only a way to excite it.
      wake(last);
    } else {
      const std::size_t lane = lane_for(key, event.channel);
      if (!is_live(lane) || voices[lane].key != key || voices[lane].frequency_hz == 0.0) {
        start(lane, playable_hz(key));
      }
      last = lane;
    }
    Voice& voice = voices[last];
    voice.key = static_cast<std::uint8_t>(key);
    voice.channel = event.channel;
    voice.held = true;
    voice.sustained = false;
    wake(last);
    const std::size_t lane = last;
    perform_all(lane, event.value, [&](const Control& control) {
      return control.source == Source::note && key >= control.lowest_key &&
             key <= control.highest_key;
    });
  }

  // The key's frequency, brought by octaves to where the model is stable.
  double playable_hz(int key) const {
    double hz = 440.0 * std::exp2((key + playing.transpose - 69) / 12.0);
    const double highest = std::max(1.0, playing.highest_factor);
    while (hz > 1.0 && (hz >= 0.5 * program.rate_hz ||
                        stiffness_factor(playing.mode_stiffness, playing.mode_damping, hz,
                                         program.rate_hz) > highest)) {
      hz *= 0.5;
    }
    return hz;
  }

  void note_off(const Event& event) {
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      Voice& voice = voices[lane];
      if (voice.held && voice.key == event.index && voice.channel == event.channel) {
        voice.held = false;
        if (pedal[event.channel & 15]) {
          voice.sustained = true;
        } else {
          release(lane);
        }
      }
    }
  }

  void release(std::size_t lane) {
    Voice& voice = voices[lane];
    voice.held = voice.sustained = false;
    for (const Control& control : playing.controls) {
      if (control.source != Source::note || voice.key < control.lowest_key ||
          voice.key > control.highest_key) {
        continue;
      }
      if (control.gesture == Gesture::bow) {
        hand(lane, control.target).draw(0.0, bow_pole);
      } else if (control.gesture == Gesture::hold) {
        hand(lane, control.target).follow(control.low, pole);
      }
    }
    if (playing.release_s > 0.0) {
      fade(lane, playing.release_s);
    }
  }

  void controller(const Event& event) {
    const std::uint8_t channel = event.channel & 15;
    switch (event.index) {
      case 64: {
        pedal[channel] = event.value >= 0.5;
        for (std::size_t lane = 0; lane < voices.size() && !pedal[channel]; ++lane) {
          if (voices[lane].sustained && voices[lane].channel == channel) {
            release(lane);
          }
        }
        break;
      }
      case 120:
        panic();
        break;
      case 123:
        for (std::size_t lane = 0; lane < voices.size(); ++lane) {
          if (voices[lane].held && voices[lane].channel == channel) {
            release(lane);
          }
        }
        break;
      default:
        break;
    }
    perform_all(last, event.value, [&](const Control& control) {
      return control.source == Source::controller && control.number == event.index;
    });
  }

  void panic() {
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].awake) {
        fade(lane, steal_fade_s);
      }
    }
    pedal.fill(false);
  }

  const Control* control_for(int number, Gesture gesture) const {
    for (const Control& control : playing.controls) {
      if (control.gesture == gesture && program.inputs[control.target].number == number) {
        return &control;
      }
    }
    return nullptr;
  }

  void press(double amount) {
    perform_all(last, amount,
                [](const Control& control) { return control.source == Source::pressure; });
  }

  void handle(const Event& event) {
    switch (event.kind) {
      case EventKind::note_on:
        return note_on(event);
      case EventKind::note_off:
        return note_off(event);
      case EventKind::controller:
        return controller(event);
      case EventKind::pressure:
      case EventKind::key_pressure:
        return press(event.value);
      case EventKind::bend:
        bend = std::clamp(event.value, -1.0, 1.0);
        for (std::size_t lane = 0; lane < voices.size(); ++lane) {
          if (voices[lane].awake) {
            tune(lane, !playing.bare);
          }
        }
        return;
      case EventKind::custom:
        if (event.index < playing.controls.size()) {
          perform(playing.controls[event.index], last, event.value);
        }
        return;
      case EventKind::parameter:
        return set_parameter(event.index, event.value);
      case EventKind::position:
        for (std::size_t i = 0; i < program.inputs.size(); ++i) {
          if (program.inputs[i].number == event.index && !program.inputs[i].is_force) {
            move_to(i, event.value);
          }
        }
        return;
      case EventKind::force:
        for (std::size_t i = 0; i < program.inputs.size(); ++i) {
          if (program.inputs[i].number == event.index && program.inputs[i].is_force) {
            push(i, event.value, event.value2);
          }
        }
        return;
      case EventKind::pluck:
        if (const Control* control = control_for(event.index, Gesture::pluck)) {
          perform(*control, last, event.value);
        }
        return;
      case EventKind::bow:
        if (const Control* control = control_for(event.index, Gesture::bow)) {
          const double speed =
              std::copysign(event.value == 0.0 ? 0.0 : control->high, event.value) *
              std::min(1.0, std::fabs(event.value));
          wake(last);
          hand(last, control->target).draw(paced(speed, last), bow_pole);
          if (event.value2 >= 0.0) {
            press(event.value2);
          }
        }
        return;
      case EventKind::panic:
        return panic();
    }
  }

  // A force of no length is an impulse; its effect does not depend on the sample rate, nor does
  // that of a force that lasts.
  void push(std::size_t input, double force, double seconds) {
    wake(last);
    const double r = program.rate_ratio;
    const auto frames = static_cast<std::size_t>(std::max(0.0, seconds) * program.rate_hz + 0.5);
    if (frames == 0) {
      hand(last, input).strike(force * r);
    } else {
      hand(last, input).push(force * r * r, frames);
    }
  }

  // --- sound ----------------------------------------------------------------------------------

  void segment(std::span<const double* const> inputs, std::span<double* const> outputs,
               std::size_t at, std::size_t frames) {
    listen(inputs, at, frames);
    std::visit([&](auto& b) { segment_in(b, inputs, outputs, at, frames); }, bank);
    remember_audio(inputs, at + frames);
    since_settled += frames;
    if (since_settled == max_segment_frames) {
      since_settled = 0;
      for (std::size_t lane = 0; lane < voices.size(); ++lane) {
        if (voices[lane].awake) {
          settle(lane);
        }
      }
    }
    if (playing.noise) {
      for (std::size_t n = at; n < at + frames; ++n) {
        for (double* const output : outputs) {
          output[n] *= white();
        }
      }
    }
  }

  template <class T>
  void segment_in(Bank<T>& b, std::span<const double* const> inputs,
                  std::span<double* const> outputs, std::size_t at, std::size_t frames) {
    for (std::size_t group = 0; group < b.groups.size(); ++group) {
      const std::size_t first = group * lane_count<T>;
      bool any_awake = false;
      for (std::size_t i = 0; i < lane_count<T>; ++i) {
        any_awake |= voices[first + i].awake;
      }
      if (!any_awake) {
        continue;
      }
      fill_drive(b, first, inputs, at, frames);
      step_direct(program, b.groups[group], b.drive.data(), b.outputs.data(), frames);
      for (std::size_t i = 0; i < lane_count<T>; ++i) {
        if (voices[first + i].awake) {
          mix(b, first + i, i, outputs, at, frames);
        }
      }
    }
  }

  template <class T>
  void fill_drive(Bank<T>& b, std::size_t first, std::span<const double* const> inputs,
                  std::size_t at, std::size_t frames) {
    const std::size_t count = program.inputs.size();
    for (std::size_t input = 0; input < count; ++input) {
      const bool is_force = program.inputs[input].is_force;
      Drive<T>* const drive = b.drive.data() + input;
      if (const double* const audio = audio_for(input, inputs)) {
        const Control& control = *audio_control[input];
        double before = audio_before[input];
        const double scale =
            is_force ? control.high * program.rate_ratio * program.rate_ratio : control.high;
        for (std::size_t n = 0; n < frames; ++n) {
          const double value = scale * audio[at + n];
          drive[n * count].value = Lanes<T>{} + static_cast<T>(value);
          drive[n * count].velocity = Lanes<T>{} + static_cast<T>(value - before);
          before = value;
        }
        continue;
      }
      for (std::size_t i = 0; i < lane_count<T>; ++i) {
        Hand& mover = hand(first + i, input);
        for (std::size_t n = 0; n < frames; ++n) {
          const HandSample sample = is_force ? mover.next_force() : mover.next_position();
          drive[n * count].value[i] = static_cast<T>(sample.value);
          drive[n * count].velocity[i] = static_cast<T>(sample.velocity);
        }
      }
    }
  }

  const double* audio_for(std::size_t input, std::span<const double* const> inputs) const {
    const Control* const control = audio_control[input];
    return control != nullptr && control->number < inputs.size() ? inputs[control->number]
                                                                 : nullptr;
  }

  // Sound at an audio input wakes the voice that it drives.
  void listen(std::span<const double* const> inputs, std::size_t at, std::size_t frames) {
    for (std::size_t input = 0; input < program.inputs.size(); ++input) {
      const double* const audio = audio_for(input, inputs);
      if (audio != nullptr && std::any_of(audio + at, audio + at + frames,
                                          [](double sample) { return sample != 0.0; })) {
        wake(last);
      }
    }
  }

  // The last position of an audio input, for the velocity of the next segment's first sample.
  void remember_audio(std::span<const double* const> inputs, std::size_t end) {
    for (std::size_t input = 0; input < program.inputs.size(); ++input) {
      if (const double* const audio = audio_for(input, inputs)) {
        audio_before[input] = audio_control[input]->high * audio[end - 1];
      }
    }
  }

  template <class T>
  void mix(Bank<T>& b, std::size_t lane, std::size_t i, std::span<double* const> outputs,
           std::size_t at, std::size_t frames) {
    Voice& voice = voices[lane];
    const std::size_t channels = program.outputs.size();
    double peak = 0.0;
    bool in_bounds = true;
    for (std::size_t n = 0; n < frames * channels; ++n) {
      const double y = std::fabs(static_cast<double>(b.outputs[n][i]));
      in_bounds &= y < runaway;  // false for what is no number
      peak = std::max(peak, y);
    }
    if (!in_bounds) {
      ++resets;
      rest_lane(lane);
      return;
    }
    for (std::size_t n = 0; n < frames; ++n) {
      voice.gain = std::max(0.0, voice.gain + voice.gain_step);
      const double gain = playing.gain * voice.gain;
      for (std::size_t channel = 0; channel < channels; ++channel) {
        outputs[channel][at + n] +=
            gain * static_cast<double>(b.outputs[n * channels + channel][i]);
      }
    }
    voice.peak = std::max(voice.peak, peak);
  }

  // Keeps the voice's level and sends it to sleep when it has faded or come to rest. Once in
  // max_segment_frames, counted from the engine's start: so what sleeps or gives way does not
  // depend on how the time is cut into blocks.
  void settle(std::size_t lane) {
    Voice& voice = voices[lane];
    constexpr std::size_t frames = max_segment_frames;
    const double peak = voice.peak * playing.gain * voice.gain;
    voice.peak = 0.0;
    voice.level = std::max(peak, voice.level * std::exp(-static_cast<double>(frames) /
                                                        (level_memory_s * program.rate_hz)));
    if (voice.fading && voice.gain == 0.0) {
      voice = Voice{};
      return;
    }
    voice.quiet_frames = peak < quiet_level ? voice.quiet_frames + frames : 0;
    if (playing.bare || voice.held || voice.sustained ||
        static_cast<double>(voice.quiet_frames) < quiet_s * program.rate_hz) {
      return;
    }
    voice.quiet_frames = 0;
    for (std::size_t input = 0; input < program.inputs.size(); ++input) {
      if (hand(lane, input).is_moving()) {
        return;
      }
    }
    if (is_at_rest(lane)) {
      const double frequency_hz = voice.frequency_hz;
      voice = Voice{};
      voice.frequency_hz = frequency_hz;
    }
  }

  // Whether nothing moves anywhere: a slow wave may still be on its way to the output.
  bool is_at_rest(std::size_t lane) const {
    const double bound = quiet_level / std::max(1e-30, playing.gain);
    return std::visit(
        [&](const auto& b) {
          const std::size_t width = b.lanes() / b.groups.size();
          const auto& state = b.groups[lane / width];
          for (std::size_t i = 0; i < program.moving; ++i) {
            const double x = static_cast<double>(state.x[i][lane % width]) - program.position[i];
            if (!(std::fabs(x) < bound)) {
              return false;
            }
          }
          return true;
        },
        bank);
  }

  // Uniform in -1..1: xorshift, from a fixed seed so that a render repeats.
  double white() {
    noise ^= noise << 13;
    noise ^= noise >> 7;
    noise ^= noise << 17;
    return static_cast<double>(static_cast<std::int64_t>(noise)) * 0x1p-63;
  }

  Program program;
  Playing playing;
  std::variant<Bank<float>, Bank<double>> bank;
  std::vector<Voice> voices;                  // [lane]
  std::vector<Hand> hands;                    // [lane][input]
  std::vector<double> parameters;             // as they are now
  std::vector<std::uint16_t> changes;         // parameters, since the last take_changes()
  std::vector<std::uint16_t> told;            // what the last one gave
  std::vector<double> rest;                   // [input] where a new voice's hand starts
  std::vector<const Control*> audio_control;  // [input] null where no audio drives it
  std::vector<double> audio_before;           // [input]
  double pole = 0.0;
  double bow_pole = 0.0;
  double bend = 0.0;
  std::array<bool, 16> pedal{};
  std::size_t last = 0;           // the lane that was played last: direct gestures act on it
  std::size_t since_settled = 0;  // frames, below max_segment_frames between two segments
  std::uint64_t births = 0;
  std::uint64_t resets = 0;
  std::uint64_t stolen = 0;
  std::uint64_t noise = 0x9e3779b97f4a7c15u;
};

Engine::Engine(Program program, Playing playing, Precision precision)
    : voices_(std::make_unique<Voices>(std::move(program), std::move(playing), precision)) {}

Engine::~Engine() = default;

void Engine::process(std::span<const Event> events, std::span<const double* const> inputs,
                     std::span<double* const> outputs, std::size_t frames) noexcept {
  for (double* const output : outputs) {
    std::fill(output, output + frames, 0.0);
  }
  std::size_t next = 0;
  std::size_t at = 0;
  while (at < frames) {
    while (next < events.size() && events[next].frame <= at) {
      voices_->handle(events[next++]);
    }
    std::size_t end = std::min(frames, at + max_segment_frames - voices_->since_settled);
    if (next < events.size()) {
      end = std::min<std::size_t>(end, events[next].frame);
    }
    voices_->segment(inputs, outputs, at, end - at);
    at = end;
  }
}

std::span<const std::uint16_t> Engine::take_changes() {
  voices_->told.swap(voices_->changes);
  voices_->changes.clear();
  return voices_->told;
}

double Engine::parameter(std::uint16_t index) const {
  return voices_->parameters[index];
}

int Engine::output_count() const {
  return static_cast<int>(voices_->program.outputs.size());
}

double Engine::rate_hz() const {
  return voices_->program.rate_hz;
}

EngineMeters Engine::meters() const {
  EngineMeters meters;
  for (const Voice& voice : voices_->voices) {
    meters.voices += voice.awake && !voice.fading && voice.level > quiet_level ? 1 : 0;
  }
  meters.resets = voices_->resets;
  meters.stolen = voices_->stolen;
  return meters;
}

double stiffness_factor(double mode_stiffness, double mode_damping, double frequency_hz,
                        double rate_hz) {
  if (!(mode_stiffness > 0.0)) {
    return 1.0;
  }
  const double theta = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  const double z = std::clamp(mode_damping, 0.0, 0.999);
  const double stiffness = 2.0 - z - 2.0 * std::sqrt(1.0 - z) * std::cos(theta);
  return std::max(1e-6, stiffness / mode_stiffness);
}

}  // namespace ressort
