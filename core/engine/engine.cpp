// The player: dispatches events, and passes each block through voices, parameters, gestures,
// kernels, the mix and the energy watch.
#include "core/engine/engine.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "core/engine/audio_inputs.h"
#include "core/engine/body.h"
#include "core/engine/comparison.h"
#include "core/engine/energy_watch.h"
#include "core/engine/gestures.h"
#include "core/engine/keyboard.h"
#include "core/engine/lfos.h"
#include "core/engine/mixing.h"
#include "core/engine/output_levels.h"
#include "core/engine/parameters.h"
#include "core/engine/struck_nodes.h"
#include "core/engine/takeover.h"
#include "core/engine/variation.h"
#include "core/engine/viewer.h"
#include "core/midi_number.h"

namespace ressort::engine {
namespace {

// Resizes the per-parameter and per-part tables.
Playing completed(Playing playing, const Machine& machine) {
  playing.limits.resize(machine.parameters.size());
  playing.home.resize(machine.parameters.size());
  playing.rest_bounds.resize(machine.parts.size());
  return playing;
}

using enum MidiNumber::Controller;

bool is_for_a_channel(EventKind kind) {
  return kind == EventKind::note_on || kind == EventKind::note_off ||
         kind == EventKind::controller || kind == EventKind::pressure ||
         kind == EventKind::key_pressure || kind == EventKind::bend;
}

}  // namespace

struct Engine::Player {
  using AnyBank = std::variant<Bank<float>, Bank<double>>;

  Player(Machine machine_in, Playing playing_in, Precision precision, Isa isa,
         const Progress& progress, Executor* executor)
      : machine(std::move(machine_in)),
        playing(completed(std::move(playing_in), machine)),
        keyboard(playing, machine.rate_hz, machine.channels),
        bank(precision == Precision::float32 ? AnyBank(std::in_place_type<Bank<float>>, machine,
                                                       voices.size(), isa, executor, progress)
                                             : AnyBank(std::in_place_type<Bank<double>>, machine,
                                                       voices.size(), isa, executor, progress)),
        parameters(machine, playing, voices.size()),
        gestures(machine, playing),
        lfos(playing, machine.rate_hz),
        variation(playing.variation, machine.rate_hz),
        audio(machine, playing, std::visit([](const auto& b) { return b.mixer.is_silent; }, bank)),
        watch(machine, playing, voices.size()),
        levels(machine, playing),
        mixing(playing),
        comparison(playing, machine.rate_hz, keyboard.voices.size()),
        share(playing.share),
        viewer(machine.rate_hz) {
    keyboard.wake(0);
    gestures.reset_drivers(voices[0], 0);
    std::visit([&](auto& b) { apply_changes(b); }, bank);
    voices[0].level = 0.0;  // it plays no note, so the first note may steal it
  }

  // --- events ---

  void handle(const Event& event) {
    const bool is_number = std::isfinite(event.value) && std::isfinite(event.value2);
    const std::uint8_t channel = event.channel % Channels::count;
    if ((!is_number && event.kind != EventKind::panic) ||
        (is_for_a_channel(event.kind) && !listens_to(channel))) {
      return;
    }
    if (!variation.delay(event)) {
      dispatch(event, channel);
    }
  }

  // Handles the events that have waited until now.
  void handle_due() {
    while (const auto event = variation.take_due()) {
      dispatch(*event, event->channel % Channels::count);
    }
  }

  void dispatch(const Event& event, std::uint8_t channel) {
    follow_tuning_parameter();
    switch (event.kind) {
      case EventKind::note_on:
        return press_key(event);
      case EventKind::note_off:
        return release_key(event);
      case EventKind::controller:
        return turn_controller(event);
      case EventKind::program:
      case EventKind::clock:
        return;
      case EventKind::tempo:
        return lfos.set_tempo(event.value);
      case EventKind::pressure:
        return play_controls(Source::pressure, 0, event.value, {.channels = reached_by(channel)});
      case EventKind::key_pressure:
        return play_controls(Source::pressure, 0, event.value,
                             {.channels = reached_by(channel), .key = event.index});
      case EventKind::bend:
        return keyboard.bend(channel, event.value);
      case EventKind::key_tuning:
        if (event.index < key_count && event.value >= 0.0) {
          keyboard.retune_key(event.index, event.value, event.value2 != 0.0,
                              parameters.highest_factor());
        }
        return;
      case EventKind::tuning_reset:
        return keyboard.reset_tuning(parameters.highest_factor());
      case EventKind::custom:
        if (event.index < playing.controls.size()) {
          gestures.play(playing.controls[event.index], event.value, {}, keyboard, parameters);
        }
        return;
      case EventKind::parameter:
        return parameters.set(event.index, event.value);
      case EventKind::gesture:
        return gestures.play_live(event, keyboard, parameters);
      case EventKind::strike:
        return std::visit([&](auto& b) { strike(b, event); }, bank);
      case EventKind::panic:
        return panic();
    }
  }

  void play_controls(Source source, int number, double amount, const Scope& scope) {
    lfos.scale(source, number, amount, scope, keyboard);
    gestures.play(source, number, amount, scope, keyboard, parameters);
  }

  ChannelMask reached_by(std::uint8_t channel) const { return keyboard.channels().reach(channel); }

  // The notes with an ID have channels of their own, which every preset listens to.
  bool listens_to(std::uint8_t channel) const {
    return channel >= midi_channel_count || has_channel(playing.channels, channel);
  }

  void press_key(const Event& event) {
    const std::uint8_t channel = event.channel % Channels::count;
    if (event.index >= key_count) {
      return;
    }
    ++notes;
    const double velocity =
        variation.varied(playing.velocity(event.value * keyboard.channels().softness(channel)));
    if (!owns_note(channel, event.index)) {
      gestures.follow_other_engine(event.index, velocity, channel, keyboard, parameters);
      return;
    }
    const Press press = keyboard.press_key(event.index, velocity, channel,
                                           parameters.highest_factor(), event.value2);
    if (press == Press::starts || press == Press::strikes) {
      begin_note(press, event.index, velocity);
    }
  }

  // Plays a note on the latest voice, which starts or sounds already.
  void begin_note(Press press, int key, double velocity) {
    const std::size_t lane = voices.latest();
    if (press == Press::starts) {
      gestures.reset_drivers(voices[lane], lane);
    }
    lfos.restart(lane, notes, keyboard);
    strike_note(key, velocity);
    lfos.follow_level(lane, keyboard);
  }

  // Plays the note controls of the latest voice.
  void strike_note(int key, double velocity) {
    keyboard.set_velocity(voices[voices.latest()], velocity);
    play_controls(Source::note, key, velocity,
                  {.channels = channel_bit(voices[voices.latest()].channel)});
  }

  // Returns whether this engine plays the note, of several engines that share them. The first
  // engine plays everything that uses one voice only.
  bool owns_note(std::uint8_t channel, std::size_t key) {
    const bool is_next = share.owns(channel, key);
    const bool is_one_voice = playing.tuning == Tuning::fixed || keyboard.is_mono(channel);
    return is_one_voice ? share.is_first() : is_next;
  }

  void release_key(const Event& event) {
    const std::uint8_t channel = event.channel % Channels::count;
    if (const auto earlier =
            keyboard.return_to_held_key(event.index, channel, parameters.highest_factor())) {
      if (earlier->press == Press::starts) {
        begin_note(earlier->press, earlier->key, earlier->velocity);
      } else if (earlier->press == Press::strikes) {
        strike_note(earlier->key, earlier->velocity);  // a bow's vibrato does not restart
      }
      return;
    }
    release_voices([&](Voice& voice) {
      return keyboard.release_key(voice, event.index, channel, event.value);
    });
    damp_keyless();
  }

  // Releases the voices for which is_released() is true.
  template <class IsReleased>
  void release_voices(IsReleased&& is_released) {
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (is_released(voices[lane])) {
        gestures.end(voices[lane], lane);
        keyboard.release(voices[lane]);
        gestures.play_release(lane, keyboard, parameters);
      }
    }
  }

  // Releases the voices that a pedal on this channel held.
  void release_by_pedal(std::uint8_t channel) {
    release_voices([&](Voice& voice) { return keyboard.is_released_by_pedal(voice, channel); });
  }

  // Resets a channel. The preset's controls learn that the sustain pedal is up.
  void reset_controllers(std::uint8_t channel) {
    const bool was_down = keyboard.channels().damper(channel) < 1.0;
    keyboard.reset_controllers(channel);
    release_by_pedal(channel);
    if (was_down) {
      play_controls(Source::controller, sustain_pedal, 0.0, {.channels = reached_by(channel)});
    }
  }

  // Silences everything and lifts all pedals, for the preset's controls too.
  void panic() {
    share.restart();
    variation.drop(all_channels);
    mute_body();
    bool was_down = false;
    for (std::uint8_t channel = 0; channel < Channels::count; ++channel) {
      was_down |= keyboard.channels().damper(channel) < 1.0;
    }
    keyboard.panic();
    if (was_down) {
      play_controls(Source::controller, sustain_pedal, 0.0, {.channels = all_channels});
    }
  }

  void release_all(ChannelMask channels) {
    keyboard.forget_keys(channels);
    release_voices([&](Voice& voice) {
      return has_channel(channels, voice.channel) &&
             keyboard.release_key(voice, voice.key, voice.channel, usual_release_velocity);
    });
  }

  // Damps voices that were excited without a key, once the last key is released. Bows and audio
  // inputs keep them sounding.
  void damp_keyless() {
    for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
      if (audio.drives(input)) {
        return;
      }
    }
    if (voices.is_any_held()) {
      return;
    }
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].is_live() && !voices[lane].has_key && !gestures.is_any_bowed(lane)) {
        keyboard.damp_keyless(voices[lane]);
      }
    }
  }

  // Applies a controller's standard meaning, and then the preset's controls of that number.
  void turn_controller(const Event& event) {
    const std::uint8_t channel = event.channel % Channels::count;
    if (keyboard.channels().is_ignored(channel, event.index)) {
      return;
    }
    const ChannelMask reached = reached_by(channel);
    const double modulation = keyboard.channels().modulation(channel);
    if (event.index == all_sound_off || event.index >= all_notes_off) {
      variation.drop(reached);
    }
    if (event.index == all_sound_off) {
      keyboard.silence(channel);
      keyboard.forget_keys(reached);
      if (std::none_of(voices.begin(), voices.end(),
                       [](const Voice& voice) { return voice.is_live(); })) {
        mute_body();  // no other channel plays it
      }
    } else if (event.index == reset_all_controllers) {
      reset_controllers(channel);
    } else if (event.index >= all_notes_off) {
      release_all(reached);
      if (event.index == mono_on || event.index == poly_on) {
        keyboard.set_mono(channel, event.index == mono_on);
      }
    } else if (const auto change = keyboard.turn_controller(channel, event.index, event.value);
               change == Channels::Change::sustain || change == Channels::Change::sostenuto) {
      release_by_pedal(channel);
    } else if (change == Channels::Change::zones) {
      const ChannelMask rezoned = keyboard.channels().rezoned();
      release_all(rezoned);
      for (std::uint8_t other = 0; other < Channels::count; ++other) {
        if (has_channel(rezoned, other)) {
          reset_controllers(other);
        }
      }
    }
    if (event.index != Channels::modulation_wheel) {
      play_controls(Source::controller, event.index, event.value, {.channels = reached});
    }
    // The wheel's depth may have changed, or a reset may have moved the wheel.
    const double new_modulation = keyboard.channels().modulation(channel);
    if (event.index == Channels::modulation_wheel || new_modulation != modulation) {
      play_controls(Source::controller, Channels::modulation_wheel, new_modulation,
                    {.channels = reached});
    }
  }

  void mute_body() {
    if (body) {
      body->mute();
    }
  }

  // Strikes the most recent voice. The force is scaled so that the displacement does not depend on
  // pitch.
  template <class T>
  void strike(Bank<T>& b, const Event& event) {
    const StruckNodes::At at = struck.find(event.value2);
    if (at.part >= b.parts.size()) {
      return;
    }
    const std::size_t lane = voices.latest();
    gestures.wake(keyboard, lane);
    apply_changes(b);
    PartBank<T>& part = b.parts[at.part];
    Kernel<T>& kernel = part.of(lane);
    const double force = event.value * machine.rate_ratio * std::sqrt(voices[lane].factor);
    const auto change = struck.change(at, force, [&](std::uint32_t c) {
      return static_cast<double>(kernel.coefficients.value[c * part.width + lane % part.width]);
    });
    kernel.strike(lane % part.width, change.nodes, change.speeds);
    watch.mark_driven(voices[lane], lane, at.part);
  }

  // --- sound ---

  // Plays as much of the segment as can be computed in one go, through the body if there is one.
  // Returns its end.
  std::size_t play_through(const Segment& segment) {
    if (!body) {
      return play(segment);
    }
    const std::size_t frames = play(body->start(segment));
    body->play(segment, frames, parameters.values());
    return segment.at + frames;
  }

  std::size_t play(Segment segment) {
    if (voices.is_idle() && !audio.find_sound(segment)) {
      make_noise(segment, true);
      audio.keep_last_samples(segment);
      since_update = (since_update + segment.frames) % max_block_frames;
      return segment.end();
    }
    segment.frames = std::min(segment.frames, max_block_frames - since_update);
    if (audio.find_sound(segment)) {
      gestures.wake(keyboard, voices.latest());
    }
    std::visit([&](auto& b) { play(b, segment); }, bank);
    audio.keep_last_samples(segment);
    make_noise(segment, false);
    return segment.end();
  }

  void make_noise(const Segment& segment, bool is_silent) {
    if (playing.noise) {
      mixing.make_noise(segment, std::visit([](const auto& b) { return b.mixer.make_noise; }, bank),
                        is_silent);
    }
  }

  template <class T>
  void play(Bank<T>& b, const Segment& segment) {
    apply_changes(b);
    const auto drive = [&](PartBank<T>& part, const VoiceGroup& group) {
      if (watch.has_frozen()) {
        unfreeze_driven(part.program, group);
      }
      if (!watch.is_any_stepped(group, voices)) {
        return false;
      }
      const Gestures::RowState row = gestures.write_row(b, group, voices);
      const bool is_all_audio = row.is_uniform && audio.drives_all(part.program);
      b.is_common = row.is_uniform && b.may_be_common(group.part);
      if (!is_all_audio) {
        gestures.fill_inputs(b, group, segment.frames, row, voices, watch);
      }
      audio.add(b, group, segment.frames, is_all_audio, voices, watch);
      parameters.fill_audio(b, group, segment, voices);
      return true;
    };
    const auto mix = [&](PartBank<T>& part, const VoiceGroup& group, bool has_stepped) {
      if (watch.has_frozen()) {
        mixing.add_frozen(part.program, group, segment, voices, watch);
      }
      if (has_stepped) {
        differentiate(b, group, segment.frames);
        levels.apply(b, group, segment.frames);
        mixing.add(b, group, segment, voices, watch, comparison);
      }
    };
    b.step(segment.frames, voices.awake_end(), drive, mix);
    levels.advance(segment.frames);
    voices.advance_gains(segment.frames);
    if (comparison.is_needed(voices)) {
      comparison.advance(segment.frames, voices, [&](Voice& voice) { keyboard.invert(voice); });
    }
    since_update += segment.frames;
    if (since_update == max_block_frames) {
      since_update = 0;
      update(b);
      viewer.advance(b, voices.latest());
    }
  }

  // Brings kernels and levels to the state that the events before a segment have set.
  template <class T>
  void apply_changes(Bank<T>& b) {
    follow_tuning_parameter();
    if (voices.has_changed() || parameters.has_changed()) {
      keyboard.update_factors(parameters.has_changed_highest_factor(), parameters.highest_factor());
      gestures.follow_pitch_changes(voices);
      if (parameters.has_changed()) {
        levels.follow(machine, parameters.values(), !voices.is_any_audible());
      }
      parameters.apply(b, voices, watch);
      voices.clear_changes();
    }
  }

  // Retunes keys to the parameter of Playing::along.
  void follow_tuning_parameter() {
    if (!playing.along.at.empty()) {
      keyboard.set_tuning_parameter(parameters.values()[playing.along.parameter]);
    }
  }

  // Unfreezes the parts of a group whose inputs are driven.
  void unfreeze_driven(const Program& program, const VoiceGroup& group) {
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      const auto is_driven = [&](const InputSlot& input) {
        return audio.drives(input.input) || gestures.is_moving(lane, input.input);
      };
      if (voices[lane].awake && watch.is_frozen(lane, group.part) &&
          std::any_of(program.inputs.begin(), program.inputs.end(), is_driven)) {
        watch.mark_driven(voices[lane], lane, group.part);
      }
    }
  }

  // The pitch of a lane without a voice, which should take the fewest steps.
  static constexpr VoicePitch resting{.warp = 1.0, .share = 0.0, .is_new = true};

  // Updates glides, energy and sleep. Called once in max_block_frames, counted from the engine's
  // start, so that the result does not depend on the block size.
  template <class T>
  void update(Bank<T>& b) {
    if (voices.is_idle()) {
      return;
    }
    voices.advance_glides();
    lfos.advance(keyboard);
    parameters.advance();
    watch.inspect_next(b, voices, parameters.values());
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      Voice& voice = voices[lane];
      const bool was_awake = voice.awake;
      // A quiet voice sleeps only if nothing moves anywhere: a slow wave may still be on its way to
      // the output.
      if (was_awake && voices.update(voice) && !gestures.is_any_moving(lane) &&
          (voices.may_sleep_moving(voice) ||
           std::all_of(b.parts.begin(), b.parts.end(), [&](const PartBank<T>& part) {
             return part.of(lane).is_near_start(lane % part.width, quiet_position);
           }))) {
        voices.sleep(voice);
      }
      if (was_awake && !voice.awake) {
        watch.reset(lane);
        for (PartBank<T>& part : b.parts) {
          part.of(lane).tune(lane % part.width, resting);
        }
      }
    }
    watch.update_reading(voices);
  }

  // --- readings ---

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
    if (body) {
      body->add_to(meters);
    }
    return meters;
  }

  bool request_slow_view(std::span<double> numbers) {
    const Voice& voice = voices[voices.latest()];
    const bool has_pitch = !playing.pitches.factors.empty() && voice.awake;
    viewer.request_slow_view(
        has_pitch ? numbers : std::span<double>(),
        has_pitch ? playing.pitches.frequency_at(keyboard.initial_factor(voice)) : 0.0);
    return has_pitch;
  }

  // --- take-over ---

  bool can_continue_from(const Player& from) {
    const bool may_take_over = std::visit(
        [&](auto& b) {
          const auto* const other = std::get_if<std::remove_reference_t<decltype(b)>>(&from.bank);
          return other != nullptr && can_take_over(b, *other, from.voices);
        },
        bank);
    return may_take_over && body.has_value() == from.body.has_value() &&
           (!body || body->can_continue_from(*from.body));
  }

  bool continue_from(const Player& from) {
    if (!can_continue_from(from)) {
      return false;
    }
    take_over_voices(from);
    if (body) {
      body->continue_from(*from.body);
    }
    return true;
  }

  bool renumber_from(const Player& from) {
    if (from.voices.size() != voices.size() || !can_continue_from(from)) {
      return false;
    }
    take_over_voices(from);
    if (body) {
      body->renumber_from(*from.body);
    }
    keyboard.renumber(playing.gain != 0.0 ? from.playing.gain / playing.gain : 1.0);
    for (std::size_t i = 0; i < machine.parameters.size(); ++i) {
      if (machine.parameters[i] != from.machine.parameters[i]) {
        parameters.set(i, machine.parameters[i]);
      }
    }
    return true;
  }

  // Takes over everything but the body.
  void take_over_voices(const Player& from) {
    std::visit(
        [&](auto& b) {
          take_over(b, std::get<std::remove_reference_t<decltype(b)>>(from.bank), from.voices);
        },
        bank);
    keyboard.continue_from(from.keyboard);
    parameters.continue_from(from.parameters);
    gestures.continue_from(from.gestures);
    lfos.continue_from(from.lfos);
    variation.continue_from(from.variation);
    notes = from.notes;
    audio.continue_from(from.audio);
    watch.continue_from(from.watch);
    levels.continue_from(from.levels);
    mixing.continue_from(from.mixing);
    share.adopt(from.share);
    since_update = from.since_update;
  }

  const Machine machine;
  const Playing playing;
  const double quiet_position = quiet_level / std::max(1e-30, playing.gain_of_loudest_key());
  StruckNodes struck{machine};
  Keyboard keyboard;
  Voices& voices = keyboard.voices;
  AnyBank bank;
  Parameters parameters;
  Gestures gestures;
  Lfos lfos;
  NoteVariation variation;
  AudioInputs audio;
  EnergyWatch watch;
  OutputLevels levels;
  Mixing mixing;
  Comparison comparison;
  NoteShare share;
  Viewer viewer;
  std::uint64_t notes = 0;       // note-ons so far, the same in all engines that share them
  std::optional<Body> body;      // empty: the voices themselves are heard
  std::size_t since_update = 0;  // frames, less than max_block_frames between segments
};

// --- the engine ---------------------------------------------------------------------------------

Engine::Engine(Machine machine, Playing playing, Precision precision, Isa isa,
               const Progress& progress, Executor* executor)
    : player_(std::make_unique<Player>(std::move(machine), std::move(playing), precision, isa,
                                       progress, executor)) {}

Engine::~Engine() = default;

void Engine::set_body(std::unique_ptr<Engine> body, std::vector<SharedParameter> shared) {
  player_->body.emplace(std::move(body), std::move(shared), player_->machine.channels);
}

void Engine::process(std::span<const Event> events, std::span<const double* const> inputs,
                     std::span<double* const> outputs, std::size_t frames) noexcept {
  for (double* const output : outputs) {
    std::fill(output, output + frames, 0.0);
  }
  std::size_t next = 0;
  std::size_t at = 0;
  while (at < frames) {
    player_->handle_due();
    while (next < events.size() && events[next].frame <= at) {
      player_->handle(events[next++]);
    }
    const std::size_t until =
        next < events.size() ? std::min<std::size_t>(frames, events[next].frame) : frames;
    const std::size_t before = at;
    at = player_->play_through({.inputs = inputs,
                                .outputs = outputs,
                                .at = at,
                                .frames = player_->variation.frames_left(until - at)});
    player_->variation.advance(at - before);
  }
}

bool Engine::can_continue_from(const Engine& from) {
  return player_->can_continue_from(*from.player_);
}

bool Engine::continue_from(const Engine& from) {
  return player_->continue_from(*from.player_);
}

bool Engine::renumber_from(const Engine& from) {
  return player_->renumber_from(*from.player_);
}

void Engine::adopt_channels(const Engine& from) {
  player_->keyboard.adopt_channels(from.player_->keyboard);
  player_->share.adopt(from.player_->share);
}

void Engine::set_tempo(double beats_per_s) {
  player_->lfos.set_tempo(beats_per_s);
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
  player_->viewer.watch(std::move(parts));
}

std::size_t Engine::read_positions(std::span<double> numbers) const {
  return std::visit(
      [&](const auto& b) { return player_->viewer.read(b, player_->voices.latest(), numbers); },
      player_->bank);
}

bool Engine::request_slow_view(std::span<double> numbers) {
  return player_->request_slow_view(numbers);
}

std::size_t Engine::take_slow_view() {
  return player_->viewer.take_slow_view();
}

const Machine& Engine::machine() const {
  return player_->machine;
}

bool Engine::may_have_dc() const {
  return !player_->playing.noise;
}

int Engine::output_count() const {
  return player_->body ? player_->body->output_count()
                       : static_cast<int>(player_->machine.channels);
}

EngineMeters Engine::meters() const {
  return player_->meters();
}

}  // namespace ressort::engine
