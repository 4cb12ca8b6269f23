#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"

namespace ressort::command_line {
namespace {

const char* const chart_examples =
    "How much computing buys how much accuracy: for each scene every method, precision and "
    "budget,\n"
    "and the direct method at 2, 4 and 8 times the rate, is timed (one core, all in turns, the\n"
    "fastest of several) and held against two reference solutions: the published scheme in long "
    "double, and "
    "the\n"
    "continuous network with the same M, K and Z. A mark nearer to the lower left corner is "
    "better;\n"
    "the grey stairs join what nothing beats; a red cross on the top edge says that this way "
    "blows\n"
    "up or gains energy when the scene is hit hard or its parameters are at their ends.\n"
    "In DIR: chart.csv, whose first lines say what its columns mean; SCENE.svg, SCENE.png and an\n"
    "overview, where gnuplot is installed; chart.gp, to draw them again. Leave the machine alone\n"
    "while it measures. Ctrl-C keeps the scenes that are complete.\n"
    "Without a MODEL the reference scenes: triangle, string50, string150, BowedString,\n"
    "1000massString, 20x30mesh, PhysicalLFO, ball, stiffContact.\n"
    "Examples:\n"
    "  ressort chart -o chart                      some minutes\n"
    "  ressort chart string50 my.mdl -o chart      two scenes\n";

}  // namespace

void add_chart(CLI::App& app, ChartOptions& options, int& code) {
  CLI::App* command =
      app.add_subcommand("chart", "draws what every way of computing costs and how right it is");
  command->footer(chart_examples);
  command->add_option("MODEL", options.scenes, "reference scenes, presets, models, or files");
  command->add_option("-o,--output", options.folder, "the folder for it all")->required();
  command->add_option("-t,--time", options.patience_s, "seconds to time each scene for")
      ->check(within(0.1, 3600.0))
      ->capture_default_str();
  command->callback([&options, &code] { code = start_chart(options); });
}

}  // namespace ressort::command_line
