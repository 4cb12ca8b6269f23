#include "app/commands/gallery/gallery.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <thread>

#include "app/commands/gallery/page.h"
#include "app/commands/output.h"
#include "app/commands/progress_bar.h"
#include "app/exit_code.h"
#include "app/realtime/thread_pool.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "app/session/sound_file.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr std::size_t spectrogram_rows = 217;  // two per semitone of nine octaves, and one
constexpr std::size_t spectrogram_columns = 400;
constexpr std::size_t envelope_steps = 620;
constexpr double last_ring_s = 2.15;
constexpr double margin_s = 0.15;  // cut from the end: half a window of the spectrogram
constexpr double note_length_s = 6.0;
constexpr int note_key = 57;

// Adapts the common phrase to a preset: to its range of keys, and to bowed or held notes, which are
// slower.
struct Register {
  int shift = 0;         // semitones, whole octaves
  double stretch = 1.0;  // factor on all times
};

Register register_of(const Preset& preset) {
  Register found;
  int lowest = 127;
  int highest = 0;
  bool has_notes = false;
  for (const ControlSetting& control : preset.controls) {
    if (control.source == ControlSource::note) {
      has_notes = true;
      lowest = std::min(lowest, control.lowest_key);
      highest = std::max(highest, control.highest_key);
      if (control.gesture == Gesture::bow || control.gesture == Gesture::hold) {
        found.stretch = 3.0;
      }
    }
  }
  const auto [low, high] =
      std::minmax_element(default_phrase().begin(), default_phrase().end(),
                          [](const auto& a, const auto& b) { return a.key < b.key; });
  while (has_notes && high->key + found.shift > highest && low->key + found.shift - 12 >= lowest) {
    found.shift -= 12;
  }
  while (has_notes && low->key + found.shift < lowest && high->key + found.shift + 12 <= highest) {
    found.shift += 12;
  }
  return found;
}

std::vector<PhraseNote> phrase_of(const Register& where) {
  std::vector<PhraseNote> notes = default_phrase();
  for (PhraseNote& note : notes) {
    note.key += where.shift;
    note.start_s *= where.stretch;
    note.end_s *= where.stretch;
  }
  return notes;
}

double fundamental_hz(const Preset& preset, int key) {
  return preset.keyboard ? 440.0 * std::exp2((key + preset.transpose - 69) / 12.0) : 0.0;
}

struct Take {
  Rendered rendered;
  Sound sound;
};

using ShouldContinue = std::function<bool()>;

// Renders notes to a file and reads the file.
Result<Take> play_notes(const GalleryOptions& options, const std::string& preset,
                        const std::string& file, const std::vector<PhraseNote>& notes,
                        double length_s, int voices, const ShouldContinue& should_continue) {
  const std::string path = (std::filesystem::path(options.folder) / file).string();
  auto rendered = render({.name = preset,
                          .output = path,
                          .rate_hz = options.rate_hz,
                          .seconds = length_s,
                          .phrase = to_score(notes),
                          .voices = voices,
                          .threads = 1},
                         [&](double) { return should_continue(); });
  if (!rendered) {
    return rendered.error();
  }
  if (rendered->failure || rendered->was_interrupted) {
    return rendered->failure.value_or(Error{"interrupted"});
  }
  auto sound = read_sound(path);
  if (!sound) {
    return sound.error();
  }
  return Take{*std::move(rendered), *std::move(sound)};
}

PresetFigures measure_sounds(const Take& phrase, const Take& note) {
  const auto loudness = loudness_lufs(phrase.sound);
  return {.peak_dbfs = to_dbfs(peak_of(phrase.sound)),
          .loudness_lufs = loudness ? *loudness : silence_db,
          .attack_ms = attack_ms(note.sound, {0.0, held_s}),
          .held_t60_s = t60_s(note.sound, {0.0, held_s}),
          .released_t60_s = t60_s(note.sound, {held_s, note_length_s}),
          .cpu_share = note.rendered.cpu_s * note.sound.rate_hz /
                       static_cast<double>(std::max(1LL, note.rendered.frames))};
}

std::vector<double> peaks_of(const Sound& sound, Stretch from_start, std::size_t steps) {
  std::vector<double> peaks(steps, 0.0);
  const auto frames =
      std::min(sound.frames(), static_cast<std::size_t>(from_start.to_s * sound.rate_hz));
  for (const std::vector<double>& channel : sound.channels) {
    for (std::size_t n = 0; n < frames; ++n) {
      double& peak = peaks[n * steps / frames];
      peak = std::max(peak, std::fabs(channel[n]));
    }
  }
  std::ranges::transform(peaks, peaks.begin(), to_dbfs);
  return peaks;
}

ShownPreset show(const GalleryOptions& options, const std::string& name,
                 const ShouldContinue& should_continue) {
  ShownPreset shown{.name = name};
  const auto scene = load_scene(name, {});
  if (!scene) {
    shown.failure = scene.error().message;
    return shown;
  }
  shown.description = scene->preset.description;
  const Register where = register_of(scene->preset);
  const std::vector<PhraseNote> notes = phrase_of(where);
  const double length_s = notes.back().end_s + last_ring_s;
  const int key = note_key + where.shift;
  const auto phrase = play_notes(options, name, name + ".wav", notes, length_s, 0, should_continue);
  const auto note =
      phrase ? play_notes(options, name, name + "-note.wav", {{0.0, held_s, key, note_velocity}},
                          note_length_s, 1, should_continue)
             : phrase;
  if (!note) {
    shown.failure = note.error().message;
    return shown;
  }
  for (const PhraseNote& played : notes) {
    shown.notes.push_back({played, fundamental_hz(scene->preset, played.key)});
  }
  const Stretch whole{0.0, length_s - margin_s};
  shown.peaks_dbfs = peaks_of(phrase->sound, whole, envelope_steps);
  shown.levels_dbfs = levels_db(phrase->sound, whole, whole.to_s / envelope_steps);
  shown.spectrogram = find_spectrogram(phrase->sound, whole, spectrogram_rows, spectrogram_columns);
  shown.figures = measure_sounds(*phrase, *note);
  const auto drawing = plot::draw(preset_figure(shown));
  if (!drawing) {
    shown.failure = drawing.error().message;
    return shown;
  }
  // Within a page, without the line that says that it is XML.
  shown.drawing = drawing->substr(drawing->find("<svg"));
  return shown;
}

// Plays all presets, one thread per core.
std::vector<ShownPreset> show_all(const GalleryOptions& options,
                                  const std::vector<std::string>& names,
                                  const ShouldContinue& should_continue) {
  std::vector<ShownPreset> shown(names.size());
  ProgressBar bar(!options.is_quiet);
  std::mutex mutex;  // guards the next two and the bar
  std::size_t next = 0;
  std::size_t done = 0;
  const auto work = [&] {
    while (true) {
      std::size_t mine = 0;
      {
        const std::lock_guard lock(mutex);
        if (next == names.size() || !should_continue()) {
          return;
        }
        mine = next++;
        bar.show(static_cast<double>(done) / static_cast<double>(names.size()), names[mine]);
      }
      ShownPreset made = show(options, names[mine], should_continue);
      const std::lock_guard lock(mutex);
      ++done;
      shown[mine] = std::move(made);
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t i = 1; i < std::min(core_count(), names.size()); ++i) {
    threads.emplace_back(work);
  }
  work();
  for (std::thread& thread : threads) {
    thread.join();
  }
  return shown;
}

}  // namespace

int gallery(const GalleryOptions& options, const ShouldContinue& should_continue) {
  const std::vector<std::string> names = known_presets();
  if (names.empty()) {
    return reject("no presets found beside '" + models_folder() + "'");
  }
  if (const auto found = plot::check_gnuplot(); !found) {
    return reject(found.error().message);
  }
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error) {
    return reject("cannot create the folder '" + options.folder + "': " + error.message());
  }
  const std::vector<ShownPreset> shown = show_all(options, names, should_continue);
  if (!should_continue()) {
    print_error("interrupted; no page is written");
    return exit_code::our_failure;
  }
  const std::string made = made_today() + ", " + fixed(options.rate_hz, 0) + " Hz";
  const std::filesystem::path folder = options.folder;
  const bool is_forced = true;
  if (const int code =
          write_output((folder / "index.html").string(), gallery_page(shown, made), is_forced)) {
    return code;
  }
  if (const int code =
          put_figure((folder / "spectra.png").string(), gallery_figure(shown), is_forced)) {
    return code;
  }
  int code = exit_code::done;
  for (const ShownPreset& preset : shown) {
    if (!preset.failure.empty()) {
      print_error(preset.name + ": not played: " + preset.failure);
      code = exit_code::our_failure;
    }
  }
  if (!options.is_quiet) {
    std::printf("%s\n\n%s: %s\n", table(gallery_table(shown)).c_str(),
                (folder / "index.html").c_str(),
                counted(shown.size(), "preset", "presets").c_str());
  }
  return code;
}

}  // namespace ressort::commands
