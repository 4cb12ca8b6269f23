#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"

namespace ressort::command_line {
namespace {

const char* const export_examples =
    "FAUST (faust.grame.fr) makes plugins, web pages and programs for boards of it. A slider for\n"
    "each parameter, the preset's range where there is one; input and output N of the model are\n"
    "channel N. It is the network alone: no notes, no gain. It computes what 'ressort render' of\n"
    "the bare .mdl does, sample by sample, at every rate; give faust -double for long decays.\n"
    "Examples:\n"
    "  ressort export PolyTriangle --to faust -o triangle.dsp\n"
    "  faust2jaqt triangle.dsp && ./triangle\n";

}  // namespace

void add_export(CLI::App& app, ExportOptions& options, int& code) {
  CLI::App* command = app.add_subcommand("export", "writes a model in another language");
  command->footer(export_examples);
  command->add_option("MODEL", options.name, "a preset's or a model's name, or a file")->required();
  command
      ->add_option_function<std::string>(
          "--to", [](const std::string&) {}, "the language")
      ->check(CLI::IsMember({"faust"}))
      ->required();
  command->add_option("-o,--output", options.output, "the file; without it, the screen");
  add_overwrite(*command, options.force);
  command->add_flag_callback(
      "--no-rescale", [&options] { options.rescale = false; },
      "take the model's numbers raw at rates other than 44100 Hz");
  add_motion(*command, options.third);
  command->callback([&options, &code] { code = export_to_faust(options); });
}

}  // namespace ressort::command_line
