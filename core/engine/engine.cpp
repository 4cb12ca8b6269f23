// The player: what events do, and the way of a block through voices, parameters, gestures, kernels,
// the mix and the energy watch.
#include "core/engine/engine.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>
#include <variant>

#include "core/engine/energy_watch.h"
#include "core/engine/gestures.h"
#include "core/engine/mixing/audio_inputs.h"
#include "core/engine/mixing/mixing.h"
#include "core/engine/mixing/output_levels.h"
#include "core/engine/parameters.h"
#include "core/engine/struck.h"
#include "core/engine/takeover.h"
#include "core/engine/voices.h"

namespace ressort::engine {
namespace {

// With a row for each parameter and part.
Playing completed(Playing playing, const Machine& machine) {
  playing.limits.resize(machine.parameters.size());
  playing.home.resize(machine.parameters.size());
  playing.rest_bounds.resize(machine.parts.size());
  return playing;
}

}  // namespace

struct Engine::Player {
  using AnyBank = std::variant<Bank<float>, Bank<double>>;

  Player(Machine machine_in, Playing playing_in, Precision precision, Isa isa,
         const Progress& progress, Executor* executor)
      : machine(std::move(machine_in)),
        playing(completed(std::move(playing_in), machine)),
        voices(playing, machine.rate_hz, machine.channels),
        bank(precision == Precision::float32 ? AnyBank(std::in_place_type<Bank<float>>, machine,
                                                       voices.size(), isa, executor, progress)
                                             : AnyBank(std::in_place_type<Bank<double>>, machine,
                                                       voices.size(), isa, executor, progress)),
        parameters(machine, playing),
        gestures(machine, playing, voices, parameters),
        audio(machine, playing, std::visit([](const auto& b) { return b.mixer.is_silent; }, bank)),
        watch(machine, playing, voices.size()),
        levels(machine, playing),
        mixing(playing),
        share(playing.share) {
    voices.start(0, 0.0);
    gestures.place(0);
    std::visit([&](auto& b) { apply_changes(b); }, bank);
    voices[0].level = 0.0;  // no note: the first one may take its place
  }

  // --- events ---

  // Releases the voices for which `wanted` says so.
  template <class Wanted>
  void release(Wanted&& wanted) {
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (wanted(voices[lane])) {
        gestures.release(lane);
        voices.release(voices[lane]);
      }
    }
  }

  void handle(const Event& event) {
    const bool is_number = std::isfinite(event.value) && std::isfinite(event.value2);
    if (!is_number && event.kind != EventKind::panic) {
      return;
    }
    const std::uint8_t channel = event.channel % Channels::count;
    follow_tuning();
    switch (event.kind) {
      case EventKind::note_on:
        return listens_to(channel) ? press_key(event) : void();
      case EventKind::note_off:
        return listens_to(channel) ? lift_key(event) : void();
      case EventKind::controller:
        return listens_to(channel) ? turn_controller(event) : void();
      case EventKind::program:
        return;
      case EventKind::pressure:
        return listens_to(channel) ? gestures.perform(Source::pressure, 0, event.value,
                                                      {.channels = voices.reach(channel)})
                                   : void();
      case EventKind::key_pressure:
        return listens_to(channel)
                   ? gestures.perform(Source::pressure, 0, event.value,
                                      {.channels = voices.reach(channel), .key = event.index})
                   : void();
      case EventKind::bend:
        return listens_to(channel) ? voices.bend(channel, event.value) : void();
      case EventKind::key_tuning:
        if (event.index < key_count && event.value >= 0.0) {
          voices.retune_key(event.index, event.value, event.value2 != 0.0,
                            parameters.highest_factor());
        }
        return;
      case EventKind::tuning_reset:
        return voices.reset_tuning(parameters.highest_factor());
      case EventKind::custom:
        if (event.index < playing.controls.size()) {
          gestures.perform(playing.controls[event.index], event.value);
        }
        return;
      case EventKind::parameter:
        return parameters.set(event.index, event.value);
      case EventKind::gesture:
        return gestures.perform_live(event);
      case EventKind::strike:
        return std::visit([&](auto& b) { strike(b, event); }, bank);
      case EventKind::panic:
        share.begin_anew();
        return voices.panic();
    }
  }

  // In the voice that was played last, at the same displacement whatever its pitch.
  template <class T>
  void strike(Bank<T>& b, const Event& event) {
    const StruckNodes::At at = struck.find(event.value2);
    if (at.part >= b.parts.size()) {
      return;  // nobody would hear it
    }
    const std::size_t lane = voices.last();
    gestures.wake(lane);
    apply_changes(b);
    PartBank<T>& part = b.parts[at.part];
    Kernel<T>& kernel = part.of(lane);
    const double force = event.value * machine.rate_ratio * std::sqrt(voices[lane].factor);
    const auto change = struck.change(at, force, [&](std::uint32_t c) {
      return static_cast<double>(kernel.coefficients.value[c * part.width + lane % part.width]);
    });
    kernel.strike(lane % part.width, change.nodes, change.speeds);
    watch.stir(voices[lane], lane, at.part);
  }

  // Notes with an ID are for whoever plays.
  bool listens_to(std::uint8_t channel) const {
    return channel >= midi_channel_count || has_channel(playing.channels, channel);
  }

  void press_key(const Event& event) {
    const std::uint8_t channel = event.channel % Channels::count;
    if (event.index >= key_count) {
      return;
    }
    const double velocity = playing.velocity(event.value * voices.softness(channel));
    if (!takes(channel, event.index)) {
      gestures.perform_elsewhere(event.index, velocity, channel);
      return;
    }
    const Press press =
        voices.press_key(event.index, velocity, channel, parameters.highest_factor(), event.value2);
    if (press == Press::silent || press == Press::moves) {
      return;
    }
    if (press == Press::starts) {
      gestures.place(voices.last());
    }
    gestures.perform(Source::note, event.index, velocity, gestures.of_last());
  }

  // Of several engines that share the notes.
  bool takes(std::uint8_t channel, std::size_t key) {
    const bool is_next = share.takes(channel, key);
    return playing.tuning == Tuning::fixed || voices.is_mono(channel) ? share.is_first() : is_next;
  }

  void lift_key(const Event& event) {
    const std::uint8_t channel = event.channel % Channels::count;
    if (const auto earlier = voices.go_back(event.index, channel, parameters.highest_factor())) {
      if (!voices.is_legato(channel)) {
        gestures.perform(Source::note, earlier->key, earlier->velocity, gestures.of_last());
      }
      return;
    }
    release(
        [&](Voice& voice) { return voices.lift_key(voice, event.index, channel, event.value); });
    damp_keyless();
  }

  // What a hand has set going by itself ends with the last of the keys, unless its bow or audio
  // goes on.
  void damp_keyless() {
    for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
      if (audio.moves(input)) {
        return;
      }
    }
    if (voices.is_any_held()) {
      return;
    }
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].is_live() && !voices[lane].has_key && !gestures.is_drawn(lane)) {
        voices.damp_keyless(voices[lane]);
      }
    }
  }

  // What means the same everywhere; all of it may be in the preset too.
  void turn_controller(const Event& event) {
    constexpr int modulation_wheel = 1;
    constexpr int all_sound_off = 120;
    constexpr int reset_all_controllers = 121;
    constexpr int all_notes_off = 123;  // and the modes from there on, which imply it
    constexpr int mono_on = 126;
    constexpr int poly_on = 127;
    const std::uint8_t channel = event.channel % Channels::count;
    const ChannelMask reached = voices.reach(channel);
    const double modulation = voices.modulation(channel);
    const auto let_go = [&] {
      release([&](Voice& voice) { return voices.is_let_go(voice, channel); });
    };
    const auto lift_all = [&](ChannelMask channels) {
      voices.forget_keys(channels);
      release([&](Voice& voice) {
        return has_channel(channels, voice.channel) &&
               voices.lift_key(voice, voice.key, voice.channel, usual_release_velocity);
      });
    };
    if (event.index == all_sound_off) {
      voices.silence(channel);
      voices.forget_keys(reached);
    } else if (event.index == reset_all_controllers) {
      voices.reset_controllers(channel);
      let_go();
    } else if (event.index >= all_notes_off) {
      lift_all(reached);
      if (event.index == mono_on || event.index == poly_on) {
        voices.set_mono(channel, event.index == mono_on);
      }
    } else if (const auto change = voices.turn(channel, event.index, event.value);
               change == Channels::Change::sustain || change == Channels::Change::sostenuto) {
      let_go();
    } else if (change == Channels::Change::zones) {
      lift_all(voices.rezoned());
      for (std::uint8_t other = 0; other < Channels::count; ++other) {
        if (has_channel(voices.rezoned(), other)) {
          voices.reset_controllers(other);
          release([&](Voice& voice) { return voices.is_let_go(voice, other); });
        }
      }
    }
    if (event.index != modulation_wheel) {
      gestures.perform(Source::controller, event.index, event.value, {.channels = reached});
    }
    // Its depth may have changed, or a reset have put it back.
    if (event.index == modulation_wheel || voices.modulation(channel) != modulation) {
      gestures.perform(Source::controller, modulation_wheel, voices.modulation(channel),
                       {.channels = reached});
    }
  }

  // --- sound ---

  // As much of the segment as can be computed in one go; returns its end.
  std::size_t play(Segment segment) {
    if (voices.is_idle() && !playing.noise && !audio.listen(segment)) {
      audio.remember(segment);
      since_update = (since_update + segment.frames) % max_block_frames;
      return segment.end();
    }
    segment.frames = std::min(segment.frames, max_block_frames - since_update);
    if (audio.listen(segment)) {
      gestures.wake(voices.last());
    }
    std::visit([&](auto& b) { play(b, segment); }, bank);
    audio.remember(segment);
    if (playing.noise) {
      mixing.make_noise(segment);
    }
    return segment.end();
  }

  template <class T>
  void play(Bank<T>& b, const Segment& segment) {
    apply_changes(b);
    const auto drive = [&](PartBank<T>& part, const VoiceGroup& group) {
      if (watch.has_still()) {
        stir_moved(part.program, group);
      }
      if (!watch.steps(group, voices)) {
        return false;
      }
      const Gestures::Rest rest = gestures.rest(b, group);
      const bool is_all_sound = rest.is_alike && audio.move_all(part.program);
      b.is_common = rest.is_alike && b.may_be_common(group.part);
      if (!is_all_sound) {
        gestures.fill(b, group, segment.frames, rest, watch);
      }
      audio.add(b, group, segment.frames, is_all_sound, voices, watch);
      parameters.fill_audio(b, group, segment, voices);
      return true;
    };
    const auto mix = [&](PartBank<T>& part, const VoiceGroup& group, bool has_stepped) {
      if (watch.has_still()) {
        mixing.add_still(part.program, group, segment, voices, watch);
      }
      if (has_stepped) {
        levels.apply(b, group, segment.frames);
        mixing.add(b, group, segment, voices, watch);
      }
    };
    b.step(segment.frames, voices.awake_end(), drive, mix);
    levels.advance(segment.frames);
    voices.advance_gains(segment.frames);
    since_update += segment.frames;
    if (since_update == max_block_frames) {
      since_update = 0;
      update(b);
      strobe();
    }
  }

  template <class T>
  void apply_changes(Bank<T>& b) {
    follow_tuning();
    if (voices.has_changed() || parameters.has_changed()) {
      voices.retune(parameters.has_changed_highest_factor(), parameters.highest_factor());
      gestures.follow_pitches();
      if (parameters.has_changed()) {
        levels.follow(machine, parameters.values(), !voices.is_any_under_way());
      }
      parameters.apply(b, voices, watch);
      voices.forget_changes();
    }
  }

  // Keys are tuned where the parameter is that leaves them in tune.
  void follow_tuning() {
    if (!playing.along.at.empty()) {
      voices.tune_at(parameters.values()[playing.along.parameter]);
    }
  }

  // What is moved from outside does not stand still any more.
  void stir_moved(const Program& program, const VoiceGroup& group) {
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      const auto is_moved = [&](const InputSlot& input) {
        return audio.moves(input.input) || gestures.is_moving(lane, input.input);
      };
      if (voices[lane].awake && watch.is_still(lane, group.part) &&
          std::any_of(program.inputs.begin(), program.inputs.end(), is_moved)) {
        watch.stir(voices[lane], lane, group.part);
      }
    }
  }

  // Once in max_block_frames, counted from the engine's start: so what sleeps or gives way does not
  // depend on how the time is cut into blocks.
  template <class T>
  void update(Bank<T>& b) {
    if (voices.is_idle()) {
      return;
    }
    voices.glide_on();
    watch.look_around(b, voices, parameters.values());
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      Voice& voice = voices[lane];
      const bool was_awake = voice.awake;
      // Where nothing moves anywhere: a slow wave may still be on its way to the output.
      if (was_awake && voices.update(voice) && !gestures.is_moving(lane) &&
          std::all_of(b.parts.begin(), b.parts.end(), [&](const PartBank<T>& part) {
            return part.of(lane).is_near_start(lane % part.width, quiet_position);
          })) {
        voices.sleep(voice);
      }
      if (was_awake && !voice.awake) {
        watch.forget(lane);
      }
    }
    watch.read_energy(voices);
  }

  EngineMeters meters() const {
    EngineMeters meters = watch.meters(voices);
    voices.add_to(meters);
    meters.beyond = parameters.beyond();
    const auto count_modes = [&](const auto& part) {
      for (std::size_t lane = 0; lane < voices.size(); ++lane) {
        if (voices[lane].awake) {
          const Awake awake = part.of(lane).awake();
          meters.modes += awake.of;
          meters.modes_awake += awake.modes;
        }
      }
    };
    std::visit([&](const auto& b) { std::for_each(b.parts.begin(), b.parts.end(), count_modes); },
               bank);
    return meters;
  }

  std::size_t look(std::span<double> numbers) const {
    const std::size_t lane = voices.last();
    std::size_t at = 0;
    bool is_full = false;
    const auto add = [&](std::size_t more) {
      at += more;
      is_full = is_full || more == 0;
    };
    const auto look_at_part = [&](const auto& part, const Watched& wanted) {
      if (!wanted.nodes.empty()) {
        add(part.of(lane).look(lane % part.width, wanted.nodes, numbers.subspan(at)));
      }
      for (std::size_t i = 0; i < wanted.waveguides && !is_full; ++i) {
        const std::size_t room = std::min(waveguide_points, numbers.size() - at);
        add(room < waveguide_points
                ? 0
                : part.of(lane).look_along(lane % part.width, i, numbers.subspan(at, room)));
      }
    };
    std::visit(
        [&](const auto& b) {
          for (std::size_t p = 0; p < watched.size() && !is_full; ++p) {
            look_at_part(b.parts[p], watched[p]);
          }
        },
        bank);
    return at;
  }

  // Whether this is a moment for a slow look; then it is taken. Once in max_block_frames.
  void strobe() {
    ++updates;
    if (slow_numbers.empty()) {
      return;
    }
    constexpr double near = 0.02;  // periods
    const double seconds = static_cast<double>(updates * max_block_frames) / machine.rate_hz;
    const double apart = seconds * (slow_hz - 1.0 / Engine::strobe_period_s);
    if (std::fabs(apart - std::rint(apart)) < near) {
      slow_count = look(slow_numbers);
      slow_numbers = {};
    }
  }

  bool look_slowly(std::span<double> numbers) {
    slow_count = 0;
    slow_numbers = {};
    const Voice& voice = voices[voices.last()];
    if (playing.pitches.factors.empty() || !voice.awake) {
      return false;
    }
    slow_hz = playing.pitches.frequency_at(voices.first_factor(voice));
    slow_numbers = numbers;
    return true;
  }

  bool go_on_from(const Player& from) {
    const bool goes_on = std::visit(
        [&](auto& b) {
          using Same = std::remove_reference_t<decltype(b)>;
          const auto* const other = std::get_if<Same>(&from.bank);
          return other != nullptr && take_over(b, *other, from.voices);
        },
        bank);
    if (goes_on) {
      voices.go_on_from(from.voices);
      parameters.go_on_from(from.parameters);
      gestures.go_on_from(from.gestures);
      audio.go_on_from(from.audio);
      watch.go_on_from(from.watch);
      levels.go_on_from(from.levels);
      mixing.go_on_from(from.mixing);
      share.adopt(from.share);
      since_update = from.since_update;
    }
    return goes_on;
  }

  bool renumber_from(const Player& from) {
    if (from.voices.size() != voices.size() || !go_on_from(from)) {
      return false;
    }
    voices.renumber(playing.gain != 0.0 ? from.playing.gain / playing.gain : 1.0);
    for (std::size_t i = 0; i < machine.parameters.size(); ++i) {
      if (machine.parameters[i] != from.machine.parameters[i]) {
        parameters.set(i, machine.parameters[i]);
      }
    }
    return true;
  }

  const Machine machine;
  const Playing playing;
  const double quiet_position = quiet_level / std::max(1e-30, playing.gain_of_loudest_key());
  StruckNodes struck{machine};
  Voices voices;
  AnyBank bank;
  Parameters parameters;
  Gestures gestures;
  AudioInputs audio;
  EnergyWatch watch;
  OutputLevels levels;
  Mixing mixing;
  NoteShare share;
  std::vector<Watched> watched;    // [part] or empty
  std::span<double> slow_numbers;  // where a slow look goes; empty: none is wanted
  double slow_hz = 0.0;
  std::size_t slow_count = 0;
  std::uint64_t updates = 0;
  std::size_t since_update = 0;  // frames, below max_block_frames between two segments
};

// --- the engine ---------------------------------------------------------------------------------

Engine::Engine(Machine machine, Playing playing, Precision precision, Isa isa,
               const Progress& progress, Executor* executor)
    : player_(std::make_unique<Player>(std::move(machine), std::move(playing), precision, isa,
                                       progress, executor)) {}

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
      player_->handle(events[next++]);
    }
    const std::size_t until =
        next < events.size() ? std::min<std::size_t>(frames, events[next].frame) : frames;
    at = player_->play({.inputs = inputs, .outputs = outputs, .at = at, .frames = until - at});
  }
}

bool Engine::go_on_from(const Engine& from) {
  return player_->go_on_from(*from.player_);
}

bool Engine::renumber_from(const Engine& from) {
  return player_->renumber_from(*from.player_);
}

void Engine::adopt_channels(const Engine& from) {
  player_->voices.adopt_channels(from.player_->voices);
  player_->share.adopt(from.player_->share);
}

bool Engine::listens_to(std::uint8_t channel) const {
  return player_->listens_to(channel);
}

void Engine::limit_voices(int most) {
  player_->voices.limit(static_cast<std::size_t>(std::max(1, most)));
}

int Engine::voice_count() const {
  return std::max(1, player_->playing.voices);
}

std::span<const std::uint16_t> Engine::take_changes() {
  return player_->parameters.take_changes();
}

double Engine::parameter(std::uint16_t index) const {
  return player_->parameters.values()[index];
}

void Engine::watch(std::vector<Watched> parts) {
  parts.resize(player_->machine.parts.size());
  player_->watched = std::move(parts);
}

std::size_t Engine::look(std::span<double> numbers) const {
  return player_->look(numbers);
}

bool Engine::look_slowly(std::span<double> numbers) {
  return player_->look_slowly(numbers);
}

std::size_t Engine::take_slow_look() {
  return std::exchange(player_->slow_count, 0);
}

const Machine& Engine::machine() const {
  return player_->machine;
}

int Engine::output_count() const {
  return static_cast<int>(player_->machine.channels);
}

EngineMeters Engine::meters() const {
  return player_->meters();
}

}  // namespace ressort::engine
