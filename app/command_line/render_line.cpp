#include <set>
#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"

namespace ressort::command_line {
namespace {

const char* const render_examples =
    "A score is text, a line an event: TIME_SECONDS ADDRESS ARGUMENTS, the addresses being the\n"
    "OSC ones:\n"
    "  0.0  /note/on 69 100\n"
    "  0.5  /param/m_K 0.2\n"
    "A preset without a score plays a short phrase; a bare .mdl is the network alone: no gain, no\n"
    "smoothing, one channel for each output.\n"
    "Examples:\n"
    "  ressort render PolyTriangle -o out.wav\n"
    "  ressort render 20x30mesh --midi song.mid -o song.flac\n"
    "  ressort render my.mdl -o out.wav --input gesture.wav --format double\n"
    "  ressort render --all-presets -o sounds      then look at sounds/index.html\n";

}  // namespace

void add_render(CLI::App& app, RenderChoice& choice, int& code) {
  RenderOptions& options = choice.options;
  CLI::App* command = app.add_subcommand("render", "renders a model or a preset to a sound file");
  command->footer(render_examples);
  CLI::Option* model = command->add_option(
      "MODEL", options.name,
      "a preset's or a model's name, or a file; or a .ressort flight, of which\n"
      "the last 30 s are rendered, or the last --seconds");
  std::string endings;
  for (const std::string_view ending : sound_endings()) {
    endings += (endings.empty() ? "" : " ") + std::string(ending);
  }
  command
      ->add_option("-o,--output", options.output,
                   "the sound file, written over if it is there; its ending says which: " + endings)
      ->required();
  CLI::Option* seconds =
      command->add_option("-s,--seconds", choice.seconds, "how long")->check(within(0.0, 86400.0));
  CLI::Option* frames = command->add_option("--frames", choice.frames, "how long, in samples")
                            ->check(within(0.0, 1e10))
                            ->excludes(seconds);
  command->add_option("-r,--rate", options.rate_hz, "Hz")
      ->check(within(1000.0, 768000.0))
      ->capture_default_str();
  command->add_option("--input", options.input, "a sound file; its channel n drives input n");
  command->add_option("--score", options.score, "a file of events");
  command->add_option("--midi", options.midi,
                      "a Standard MIDI File, type 0 or 1; it ends when it has fallen silent");
  add_settings(*command, options.parameters);
  command
      ->add_option_function<std::string>(
          "--format",
          [&options](const std::string& word) {
            options.format = word == "float"    ? SampleFormat::float32
                             : word == "double" ? SampleFormat::float64
                                                : SampleFormat::pcm24;
          },
          "of the file's samples; without it float, or pcm24 in a .flac")
      ->check(CLI::IsMember({"float", "double", "pcm24"}))
      ->type_name("WORD");
  add_numbers(*command, options.precision, options.rescale);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict);
  add_motion(*command, options.third);
  add_force(*command, options.force);
  command->add_option("-p,--voices", options.voices, "how many notes sound at once")
      ->check(within(1, max_voices));
  add_keys(*command, options.keys);
  command->add_option("--threads", options.threads, "for large networks; without it, all cores")
      ->check(within(1, 1024));
  command->add_flag("--limit", options.limit, "keep below full scale, 1 ms late");
  command->add_flag(
      "--all-presets", choice.all_presets,
      "every preset, a phrase and a note of each, into the folder -o; index.html there\n"
      "shows their envelopes, spectrograms and figures, spectra.svg is a picture of\n"
      "all; of the other options it takes -r and -q");
  command->add_flag("-q,--quiet", choice.is_quiet, "say nothing unless something is wrong");
  command->callback([&choice, command, model, seconds, frames, &code] {
    if (choice.all_presets) {
      const std::set<std::string> taken = {"all-presets", "output", "rate", "quiet"};
      for (const CLI::Option* option : command->get_options()) {
        if (option->count() > 0 && !taken.contains(option->get_single_name())) {
          throw CLI::ExcludesError("--all-presets", option->get_name());
        }
      }
      code = gallery_command({choice.options.output, choice.options.rate_hz, choice.is_quiet});
      return;
    }
    if (model->count() == 0) {
      throw CLI::RequiredError("MODEL");
    }
    if (seconds->count() > 0) {
      choice.options.seconds = choice.seconds;
    }
    if (frames->count() > 0) {
      choice.options.frames = choice.frames;
    }
    code = render_command(choice.options, choice.is_quiet);
  });
}

}  // namespace ressort::command_line
