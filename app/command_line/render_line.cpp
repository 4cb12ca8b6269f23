#include <set>
#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/commands.h"
#include "core/ranges.h"

namespace ressort::command_line {
namespace {

const char* const render_examples =
    "A score is a text file with an event per line, TIME_SECONDS ADDRESS ARGUMENTS, with the "
    "addresses\n"
    "of OSC:\n"
    "  0.0  /note/on 69 100\n"
    "  0.5  /param/m_K 0.2\n"
    "A preset without a score plays a short phrase. A bare .mdl is the network alone: no gain, no\n"
    "smoothing, one channel per output. --all-presets writes a phrase and a note of every preset "
    "to the\n"
    "folder, index.html with their envelopes, spectrograms and figures, and spectra.png with all\n"
    "spectrograms. It needs gnuplot and accepts only -o, -r and -q.\n"
    "Examples:\n"
    "  ressort render PolyTriangle -o out.wav\n"
    "  ressort render 20x30mesh --midi song.mid -o song.flac\n"
    "  ressort render my.mdl -o out.wav --input gesture.wav --format double\n"
    "  ressort render --all-presets -o sounds      then open sounds/index.html\n";

struct RenderChoice {
  RenderOptions options;
  bool all_presets = false;
  bool is_quiet = false;
};

}  // namespace

void add_render(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand("render", "renders a preset or a model to a sound file");
  command->footer(render_examples);
  RenderChoice& choice = run_with<RenderChoice>(*command, code, [command](const auto& chosen) {
    if (!chosen.all_presets && command->count("MODEL") == 0) {
      throw CLI::RequiredError("MODEL");
    }
    if (!chosen.all_presets) {
      return render_command(chosen.options, chosen.is_quiet);
    }
    const std::set<std::string> taken = {"all-presets", "output", "rate", "quiet"};
    for (const CLI::Option* option : command->get_options()) {
      if (option->count() > 0 && !taken.contains(option->get_single_name())) {
        throw CLI::ExcludesError("--all-presets", option->get_name());
      }
    }
    return gallery_command({chosen.options.output, chosen.options.rate_hz, chosen.is_quiet});
  });
  RenderOptions& options = choice.options;
  add_model(*command, options.name,
            "preset or model, by name or file; a .ressort file (last 30 s)");
  command
      ->add_option("-o,--output", options.output,
                   "sound file to write: " + joined(sound_endings(), " "))
      ->type_name("FILE")
      ->required();
  command->add_option("-s,--seconds", options.seconds, "duration in s")
      ->check(within(0.0, 86400.0));
  command->add_option("--frames", options.frames, "duration in samples")
      ->check(within(0.0, 1e10))
      ->excludes("--seconds");
  add_rate(*command, "-r,--rate", options.rate_hz, 1000.0, 768000.0);
  command->add_option("--input", options.input, "sound file whose channel N drives input N")
      ->type_name("FILE");
  command->add_option("--score", options.score, "score file; - reads the standard input")
      ->type_name("FILE");
  command
      ->add_option("--midi", options.midi,
                   "Standard MIDI File (.mid, .rmi), rendered until it is silent")
      ->type_name("FILE");
  add_settings(*command, options.parameters);
  command
      ->add_option_function<std::string>(
          "--format",
          [&options](const std::string& word) {
            options.format = word == "float"    ? SampleFormat::float32
                             : word == "double" ? SampleFormat::float64
                                                : SampleFormat::pcm24;
          },
          "sample format: float, double or pcm24 (default float; pcm24 of .flac)")
      ->check(CLI::IsMember({"float", "double", "pcm24"}).description(""))
      ->type_name("WORD");
  add_numbers(*command, options.precision, options.rescale);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict, "the budget may be missed, or if a MIDI file is damaged");
  add_motion(*command, options.third);
  add_force(*command, options.force);
  command->add_option("-p,--voices", options.voices, "number of voices (default: the preset's)")
      ->check(within(1, max_voices));
  add_keys(*command, options.keys);
  command->add_option("--threads", options.threads, "threads for voices (default: all cores)")
      ->check(within(1, 1024));
  command->add_flag("--limit", options.limit, "limit peaks to full scale; adds 1 ms of latency");
  command->add_flag("--all-presets", choice.all_presets,
                    "render all presets to the folder -o, with a page that compares them");
  command->add_flag("-q,--quiet", choice.is_quiet, "print errors only");
}

}  // namespace ressort::command_line
