#include "app/commands/offline.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "app/commands/smf/midi_file.h"
#include "app/control/registry.h"
#include "app/realtime/process.h"
#include "app/realtime/thread_pool.h"
#include "app/session/compile_scene.h"
#include "app/session/files.h"
#include "app/session/memory.h"
#include "app/session/timing.h"
#include "app/text.h"
#include "core/compile/compile.h"
#include "core/model/language/expression.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

constexpr std::size_t block_frames = 256;
constexpr std::size_t max_score_bytes = std::size_t{64} << 20;
constexpr double ring_out_s = 2.0;
constexpr double longest_ring_s = 60.0;  // longest decay after a MIDI file
constexpr double silent_for_s = 0.5;
constexpr double silent_peak = 1e-4;  // -80 dBFS
constexpr double longest_s = 24.0 * 3600.0;

// Bytes per node of a macro until its kernel is built, and the largest number of nodes.
constexpr std::uint64_t bytes_of_node = 700;  // for a mesh; 500 for a string
constexpr std::uint64_t most_nodes = 1'000'000'000;

struct ScoredEvent {
  int line = 0;
  int column = 1;
  long long frame = 0;
  Event event;
};

Error at(const std::string& path, const Error& error) {
  return {to_string(finding_of(path, "", error))};
}

// Reads a score, which may come through a pipe or, as '-', from the standard input.
Result<std::string> read_score_text(const std::string& name) {
  const std::string path = name == "-" ? "/dev/stdin" : name;
  std::error_code error;
  if (!std::filesystem::is_fifo(path, error) && !std::filesystem::is_character_file(path, error)) {
    return read_text(path, max_score_bytes);
  }
  std::ifstream pipe(path, std::ios::binary);
  std::string text(max_score_bytes + 1, '\0');
  pipe.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(pipe.gcount()));
  return text.size() > max_score_bytes ? Result<std::string>(Error{"'" + path + "' is too long"})
                                       : std::move(text);
}

// Returns the lines of the given score, if any. Errors have the line of the score.
Result<std::vector<ScoreLine>> read_score(const RenderOptions& options) {
  if (options.score.empty()) {
    return parse_score(options.phrase);
  }
  auto text = read_score_text(options.score);
  if (!text) {
    return text.error();
  }
  if (text->starts_with("MThd")) {
    return Error{"'" + options.score + "' is a MIDI file; pass it with --midi"};
  }
  auto lines = parse_score(*text);
  return lines ? std::move(lines) : at(options.score, lines.error());
}

bool plays_notes(const std::vector<ScoreLine>& lines) {
  return std::ranges::any_of(
      lines, [](const ScoreLine& line) { return line.message.address.starts_with("/note"); });
}

// Returns a warning about options for keys that have no effect, or an empty string.
std::string unused_keys(const RenderOptions& options, bool is_bare) {
  const KeyOptions& keys = options.keys;
  const bool has_tuning =
      !keys.scale.empty() || !keys.keyboard_map.empty() || keys.a4_hz || keys.transpose != 0;
  if (keys.channels && options.midi.empty()) {
    return "--channel has no effect without --midi";
  }
  const std::string unused = has_tuning ? "the tuning" : options.voices > 0 ? "--voices" : "";
  if (!is_bare || unused.empty()) {
    return "";
  }
  return unused + " has no effect, because no key is played; pass --midi, or a --score with notes";
}

// Returns the parameters that the score sets.
std::vector<Setting> reach_of(const std::vector<ScoreLine>& lines, const Network& network) {
  constexpr std::string_view prefix = "/param/";
  std::vector<Setting> reach;
  for (const ScoreLine& line : lines) {
    const std::string_view address = line.message.address;
    const auto& arguments = line.message.arguments;
    if (!address.starts_with(prefix) || arguments.empty() ||
        !std::holds_alternative<double>(arguments[0])) {
      continue;
    }
    for (const Parameter& parameter : network.parameters) {
      if (fits(address.substr(prefix.size()), parameter.name)) {
        reach.push_back({parameter.name, std::get<double>(arguments[0])});
      }
    }
  }
  return reach;
}

// Converts the calls of a score to events. Errors have the line of the score. Warns once per
// parameter about values outside its range.
Result<std::vector<ScoredEvent>> score_events(const RenderOptions& options,
                                              const std::vector<ScoreLine>& lines,
                                              const Instrument& instrument, std::uint32_t serial,
                                              std::vector<std::string>& warnings) {
  std::vector<ScoredEvent> scored;
  std::set<std::uint16_t> warned;
  for (const ScoreLine& line : lines) {
    auto events = to_events(line.message, instrument, serial);
    if (!events) {
      return at(options.score, {events.error().message, line.line, line.column});
    }
    for (const Event& event : *events) {
      scored.push_back(
          {line.line, line.column, std::llround(line.time_s * options.rate_hz), event});
      const std::string news = describe_limit(line.message, event, instrument);
      if (!news.empty() && warned.insert(event.index).second) {
        warnings.push_back(options.score + ":" + std::to_string(line.line) + ":" +
                           std::to_string(line.column) + ": warning: " + news);
      }
    }
  }
  std::ranges::stable_sort(scored, {}, &ScoredEvent::frame);
  return scored;
}

// The signals of the model's inputs, streamed from a sound file; silence without one.
struct Inputs {
  std::optional<SoundReader> file;
  std::vector<double> interleaved;
  std::vector<double> samples;  // [channel][block_frames]
  std::vector<const double*> pointers;
  std::size_t frame = 0;  // number of frames read

  explicit Inputs(std::optional<SoundReader> from) : file(std::move(from)) {
    const std::size_t channels = file ? file->channels() : 0;
    interleaved.resize(channels * block_frames);
    samples.resize(interleaved.size());
    for (std::size_t c = 0; c < channels; ++c) {
      pointers.push_back(samples.data() + c * block_frames);
    }
  }

  // Reads the next block, with silence after the end. Fails at a sample that is not a number.
  Result<std::span<const double* const>> next(std::size_t count) {
    if (file) {
      const std::size_t got = file->read(interleaved.data(), count);
      const auto end = interleaved.begin() + static_cast<std::ptrdiff_t>(got * pointers.size());
      const auto broken =
          std::find_if(interleaved.begin(), end, [](double x) { return !std::isfinite(x); });
      if (broken != end) {
        const auto at = static_cast<std::size_t>(broken - interleaved.begin());
        return Error{"sample " + std::to_string(frame + at / pointers.size()) + " of channel " +
                     std::to_string(1 + at % pointers.size()) + " is not a number"};
      }
      frame += got;
      for (std::size_t c = 0; c < pointers.size(); ++c) {
        for (std::size_t n = 0; n < count; ++n) {
          samples[c * block_frames + n] = n < got ? interleaved[n * pointers.size() + c] : 0.0;
        }
      }
    }
    return std::span<const double* const>(pointers);
  }
};

Result<std::optional<SoundReader>> open_input(const RenderOptions& options) {
  if (options.input.empty()) {
    return std::optional<SoundReader>();
  }
  auto sound = SoundReader::open(options.input);
  if (!sound) {
    return sound.error();
  }
  if (sound->rate_hz() != options.rate_hz) {
    const std::string rate = std::to_string(static_cast<int>(sound->rate_hz()));
    return Error{"'" + options.input + "' is at " + rate + " Hz, but the render is at " +
                 std::to_string(static_cast<int>(options.rate_hz)) + " Hz; pass --rate " + rate};
  }
  if (sound->frames() < 0 && !options.frames && !options.seconds) {
    return Error{"'" + options.input + "' has no length in its header; pass --seconds"};
  }
  return std::optional<SoundReader>(*std::move(sound));
}

// Reports a value outside the preset's range, at the line that sets it.
Error beyond_range(const Scene& scene, const ParameterInfo& info) {
  Error error{"the preset limits '" + info.name + "' to the range from " +
              print_number(info.minimum) + " to " + print_number(info.maximum)};
  for (const ParameterSetting& setting : scene.preset.parameters) {
    if (setting.name == info.name) {
      error.line = setting.location.line;
      error.column = setting.location.column;
    }
  }
  return at(scene.path, error);
}

long long length_in_frames(const RenderOptions& options, const std::vector<ScoredEvent>& score,
                           const Inputs& inputs, const MidiFile& midi) {
  if (options.frames) {
    return *options.frames;
  }
  if (options.seconds) {
    return std::llround(*options.seconds * options.rate_hz);
  }
  const long long last =
      std::max(score.empty() ? 0 : score.back().frame, inputs.file ? inputs.file->frames() : 0);
  const double midi_s = options.midi.empty() ? 0.0 : midi.length_s + longest_ring_s;
  return std::max(last + std::llround(ring_out_s * options.rate_hz),
                  std::llround(midi_s * options.rate_hz));
}

// Splits the messages of a MIDI file into blocks.
class MidiPackets {
 public:
  MidiPackets(const MidiFile& file, double rate_hz) : file_(file), rate_hz_(rate_hz) {}

  // Returns the messages of a block of frames, valid until the next call.
  std::span<const MidiPacket> next(long long first, std::size_t count) {
    packets_.clear();
    for (; next_ < file_.messages.size(); ++next_) {
      const MidiFile::Message& message = file_.messages[next_];
      const long long frame = std::llround(message.time_s * rate_hz_) - first;
      if (frame >= static_cast<long long>(count)) {
        break;
      }
      packets_.push_back({static_cast<std::uint32_t>(frame), file_.bytes_of(message)});
    }
    return packets_;
  }

 private:
  const MidiFile& file_;
  double rate_hz_;
  std::size_t next_ = 0;
  std::vector<MidiPacket> packets_;
};

}  // namespace

const std::vector<PhraseNote>& default_phrase() {
  static const std::vector<PhraseNote> notes = {
      {0.0, 0.45, 57, 100}, {0.5, 0.95, 60, 90}, {1.0, 1.45, 64, 100}, {1.5, 1.95, 69, 110},
      {2.0, 3.2, 57, 80},   {2.0, 3.2, 64, 70},  {2.0, 3.2, 72, 70},
  };
  return notes;
}

std::string to_score(const std::vector<PhraseNote>& notes) {
  std::string text;
  for (const PhraseNote& note : notes) {
    const std::string key = std::to_string(note.key);
    text += print_number(note.start_s) + " /note/on " + key + " " + std::to_string(note.velocity) +
            "\n" + print_number(note.end_s) + " /note/off " + key + "\n";
  }
  return text;
}

Result<Rendered> render(const RenderOptions& options, const std::function<bool(double)>& progress) {
  // Notes need a preset: a bare model gets its default preset.
  auto lines = read_score(options);
  if (!lines) {
    return lines.error();
  }
  // Notes tune a model without a preset, from a score as from a MIDI file.
  const bool has_keys = !options.midi.empty() || plays_notes(*lines);
  auto scene = load_scene(
      options.name,
      {.bare = !has_keys,
       .third = options.third,
       .keys = options.keys,
       .most_nodes = std::clamp(free_memory_bytes() / bytes_of_node, max_macro_nodes, most_nodes),
       .progress = options.loading});
  if (!scene) {
    return scene.error();
  }
  std::vector<std::string> read = {scene->path, scene->model_path, options.score, options.input,
                                   options.midi};
  for (const BodyModel& body : scene->preset.bodies) {
    read.push_back(body.file);
  }
  if (auto spared = check_not_input(options.output, read); !spared) {
    return spared.error();
  }
  const bool is_bare = !scene->has_preset && !has_keys;
  if (!is_bare && options.score.empty() && options.phrase.empty() && options.input.empty() &&
      options.midi.empty()) {
    lines = parse_score(to_score(default_phrase()));
  }
  if (const std::string unused = unused_keys(options, is_bare); !unused.empty()) {
    scene->warnings.push_back(unused);
  }
  auto midi = options.midi.empty() ? Result<MidiFile>(MidiFile())
                                   : read_midi_file(options.midi, options.keys.song_channels);
  if (!midi) {
    return midi.error();
  }
  if (options.is_strict && !midi->warnings.empty()) {
    return Error{midi->warnings.front() + "; --strict refuses damaged files"};
  }
  scene->warnings.insert(scene->warnings.end(), midi->warnings.begin(), midi->warnings.end());
  const auto changes = std::ranges::count_if(midi->messages, [&](const MidiFile::Message& message) {
    return (midi->bytes_of(message)[0] & 0xf0) == 0xc0;
  });
  if (changes > 0) {
    scene->warnings.push_back(
        options.midi + ": " +
        counted(static_cast<std::size_t>(changes), "program change", "program changes") +
        " ignored; render plays one preset");
  }
  const auto threads = static_cast<std::size_t>(options.threads);
  if (threads > core_count()) {
    scene->warnings.push_back("--threads " + std::to_string(threads) + ": using " +
                              std::to_string(core_count()) +
                              ", the number of cores of this machine");
  }
  ThreadPool pool(threads > 0 ? std::min(threads, core_count()) : core_count());
  auto compiled = compile_scene(*scene,
                                {.rate_hz = options.rate_hz,
                                 .rescale = options.rescale,
                                 .bare = is_bare,
                                 .voices = options.voices,
                                 .precision = options.precision,
                                 .method = options.method,
                                 .budget = options.budget,
                                 .executor = &pool,
                                 .find_gain = !scene->has_preset && !is_bare,
                                 .force = options.force,
                                 .settings = options.parameters,
                                 .reach = reach_of(*lines, scene->network),
                                 .progress = options.loading,
                                 .most_bytes = free_memory_bytes()},
                                scene->warnings, options.is_strict);
  if (!compiled) {
    return compiled.error();
  }
  const Instrument instrument = compiled->instrument;
  constexpr std::uint32_t serial = 1;

  auto input = open_input(options);
  if (!input) {
    return input.error();
  }
  Inputs inputs(*std::move(input));
  auto score = score_events(options, *lines, instrument, serial, scene->warnings);
  if (!score) {
    return score.error();
  }

  Process process(options.rate_hz, options.limit);
  for (const auto& [name, value] : options.parameters) {
    const Message message{"/param/" + name, {value}};
    auto events = to_events(message, instrument, serial);
    if (!events) {
      return Error{"--set " + name + "=" + print_number(value) + ": " + events.error().message};
    }
    for (const Event& event : *events) {
      if (const std::string news = describe_limit(message, event, instrument); !news.empty()) {
        scene->warnings.push_back(news);
      } else if (event.value != value) {
        return beyond_range(*scene, instrument.parameters[event.index]);
      }
      process.schedule(0, event);
    }
  }
  process.slot.offer(new PlayingEngine{std::move(compiled->engine), serial});

  Rendered rendered{.name = scene->name,
                    .rate_hz = options.rate_hz,
                    .frames = length_in_frames(options, *score, inputs, *midi),
                    .channels = std::max(is_bare ? 1 : 2, instrument.outputs),
                    .warnings = scene->warnings};
  if (static_cast<double>(rendered.frames) > longest_s * options.rate_hz) {
    return Error{"the sound would be longer than a day"};
  }
  const auto channels = static_cast<std::size_t>(rendered.channels);
  if (progress && !progress(0.0)) {
    return Error{"interrupted before the first sample"};
  }
  const bool ends_by_itself = !options.midi.empty() && !options.frames && !options.seconds;
  const long long may_end = std::llround(midi->length_s * options.rate_hz);
  const auto expected = static_cast<double>(ends_by_itself ? may_end : rendered.frames);
  auto file =
      SoundWriter::open(options.output,
                        {.rate_hz = options.rate_hz,
                         .channels = rendered.channels,
                         .samples = options.format,
                         .frames = ends_by_itself ? std::nullopt : std::optional(rendered.frames)},
                        Existing::replace);
  if (!file) {
    return file.error();
  }
  std::vector<double> samples(channels * block_frames);
  std::vector<double> interleaved(samples.size());
  std::vector<double*> outputs;
  for (std::size_t c = 0; c < channels; ++c) {
    outputs.push_back(samples.data() + c * block_frames);
  }
  MidiPackets packets(*midi, options.rate_hz);
  std::size_t next = 0;
  double energy = 0.0;
  long long frame = 0;
  long long loud_until = may_end;
  while (frame < rendered.frames && !rendered.was_interrupted) {
    const auto count =
        static_cast<std::size_t>(std::min<long long>(block_frames, rendered.frames - frame));
    const long long end = frame + static_cast<long long>(count);
    while (next < score->size() && (*score)[next].frame < end) {
      if (!process.schedule((*score)[next].frame, (*score)[next].event)) {
        return at(options.score, {"more than " + std::to_string(Process::max_ahead) +
                                      " events within " + std::to_string(block_frames) + " samples",
                                  (*score)[next].line, (*score)[next].column});
      }
      ++next;
    }
    const auto heard = inputs.next(count);
    if (!heard) {
      return Error{"'" + options.input + "': " + heard.error().message};
    }
    const double before_ns = thread_cpu_ns();
    process.block(*heard, std::span<double* const>(outputs), count, packets.next(frame, count), 0);
    rendered.cpu_s += 1e-9 * (thread_cpu_ns() - before_ns);
    double peak = 0.0;
    for (std::size_t n = 0; n < count; ++n) {
      for (std::size_t c = 0; c < channels; ++c) {
        const double y = outputs[c][n];
        interleaved[n * channels + c] = y;
        peak = std::max(peak, std::fabs(y));
        energy += y * y;
      }
    }
    rendered.peak = std::max(rendered.peak, peak);
    if (peak > silent_peak) {
      loud_until = std::max(loud_until, end);
    }
    if (auto wrote = file->write(interleaved.data(), count); !wrote) {
      rendered.failure = wrote.error();
      return rendered;
    }
    frame = end;
    if (progress && !progress(std::min(1.0, static_cast<double>(frame) / expected))) {
      rendered.was_interrupted = true;
    }
    if (ends_by_itself &&
        static_cast<double>(frame - loud_until) > silent_for_s * options.rate_hz) {
      break;
    }
  }
  if (auto closed = file->close(); !closed) {
    rendered.failure = closed.error();
    return rendered;
  }
  rendered.frames = frame;
  rendered.rms =
      frame > 0 ? std::sqrt(energy / static_cast<double>(frame * rendered.channels)) : 0.0;
  rendered.resets = process.meters().resets;
  rendered.is_proved = instrument.verdict == Verdict::stable;
  if (const std::uint64_t wrong = process.meters().malformed; wrong > 0) {
    rendered.warnings.push_back(options.midi + ": ignored " +
                                counted(wrong, "message", "messages") +
                                " with a wrong length or checksum");
  }
  return rendered;
}

}  // namespace ressort::commands
