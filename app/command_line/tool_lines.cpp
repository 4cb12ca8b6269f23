// The command lines of check, make, export, modes, chart and reference.
#include <string>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/manual.h"
#include "app/command_line/options.h"
#include "app/commands/chart/chart.h"
#include "app/commands/check.h"
#include "app/commands/export.h"
#include "app/commands/make.h"
#include "app/commands/modes/modes.h"
#include "app/commands/reference.h"
#include "core/model/language/expression.h"

namespace ressort::command_line {
namespace {

const char* const check_examples =
    "Prints all errors and warnings as FILE:LINE:COLUMN: error: MESSAGE, then a summary of the\n"
    "model, the method of each part, and the range in which each parameter is stable.\n"
    "Examples:\n"
    "  ressort check my.mdl\n"
    "  ressort check my.mdl --json\n"
    "  ressort check old.mdl --print > new.mdl\n";

const char* const make_examples =
    "KIND, and the number of points along each side, fixed points included:\n"
    "  string N         a row with fixed ends     chain N          a row with free ends\n"
    "  stiffString N    a string with second springs K2, from each point to the next but one\n"
    "  mesh N N         a free rectangle          closedMesh N N   a rectangle with a fixed "
    "border\n"
    "  cornerMesh N N   a rectangle with fixed corners\n"
    "  triangle N       N points a side: N(N+1)/2 points, 3N(N-1)/2 links\n"
    "  hexagon N        N rings around a point: 1+3N(N+1) points, 9N^2+3N links\n"
    "Numbers are per sample at 44100 Hz: a mass M on a spring K oscillates at 7000 sqrt(K/M) Hz.\n"
    "A network without fixed points gets one more ground, so that a push does not move it away.\n"
    "Examples:\n"
    "  ressort make string 50 -o my.mdl            then: ressort play my.mdl\n"
    "  ressort make hexagon 6 --name drum -K 0.2   prints the model\n"
    "  ressort make closedMesh 150 150 --macro     prints one line\n";

const char* const export_examples =
    "FAUST (faust.grame.fr) compiles the export to plugins, web pages and embedded programs. It "
    "has\n"
    "a slider for each parameter, with the preset's range. Channels N are the model's input N and\n"
    "output N. The export has no notes and no gain. It computes the same samples as 'ressort "
    "render'\n"
    "of the bare .mdl. Compile it with 'faust -double' for long decays.\n"
    "Examples:\n"
    "  ressort export PolyTriangle --to faust -o triangle.dsp\n"
    "  faust2jaqt triangle.dsp && ./triangle\n";

const char* const modes_examples =
    "Levels are in dB below the loudest mode from that input to that output. With --json they are\n"
    "amplitudes after an impulse, levels[input][output]: a force or a position of 1 for one sample "
    "at\n"
    "44100 Hz. Bows, plucks and contacts do not touch.\n"
    "Examples:\n"
    "  ressort modes BowedString --modes 12\n"
    "  ressort modes 20x30mesh --modes 24 -o shapes.svg\n"
    "  ressort modes PolyTriangle --json | jq '.modes[0].frequency_hz'\n"
    "  ressort modes my.mdl --tune 220,440,660 -o tuned.mdl\n"
    "  ressort modes my.mdl --decay 100:6,3000:0.8 -o wood.mdl\n";

const char* const chart_examples =
    "Times every method, precision and budget on one core, and the direct method also at 2, 4 and "
    "8\n"
    "times the rate. Measures their errors against two references: the published scheme in long\n"
    "double, and the continuous network of the same M, K and Z. Marks further left are faster, "
    "marks\n"
    "further down more accurate. Grey stairs join the marks of the Pareto front. A red cross at "
    "the\n"
    "top edge marks a method that gains energy when the scene is struck ten times harder.\n"
    "Writes chart.csv, whose first lines explain its columns, and, if gnuplot is installed,\n"
    "overview.svg and SCENE.svg. Other programs that run meanwhile disturb the times. Ctrl-C "
    "keeps\n"
    "the finished scenes. Without MODEL it plays the reference scenes: triangle, string50, "
    "string150,\n"
    "BowedString, 1000massString, 20x30mesh, PhysicalLFO, ball and stiffContact.\n"
    "Examples:\n"
    "  ressort chart -o chart                      takes some minutes\n"
    "  ressort chart string50 my.mdl -o chart      two scenes\n";

// Parses "HZ:S".
DecayPoint decay_point(const std::string& text) {
  const std::size_t colon = text.find(':');
  DecayPoint point;
  if (colon == std::string::npos || !parse_number(text.substr(0, colon), point.frequency_hz) ||
      !parse_number(text.substr(colon + 1), point.t60_s)) {
    throw CLI::ValidationError("--decay", "expected HZ:SECONDS, found '" + text + "'");
  }
  return point;
}

}  // namespace

void add_check(CLI::App& app, int& code) {
  CLI::App* command =
      app.add_subcommand("check", "checks a model or a preset for errors and stability");
  command->footer(check_examples);
  CheckOptions& options = run_with<CheckOptions>(*command, code, check);
  add_model(*command, options.name, "preset or model, by name or file")->required();
  CLI::Option* json = command->add_flag_callback(
      "--json", [&options] { options.as = CheckAs::json; }, "print JSON, errors included");
  command
      ->add_flag_callback(
          "--print", [&options] { options.as = CheckAs::model; },
          "print the model alone, in the current notation")
      ->excludes(json);
  add_motion(*command, options.third);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict, "the budget may be missed");
}

void add_make(CLI::App& app, int& code) {
  CLI::App* command =
      app.add_subcommand("make", "generates a model: a string, a mesh, a triangle or a hexagon");
  command->footer(make_examples);
  MakeOptions& options = run_with<MakeOptions>(*command, code, make);
  Shape& shape = options.shape;
  add_choice<ShapeKind>(*command, "KIND", shape.kind,
                        {{"string", ShapeKind::string},
                         {"stiffString", ShapeKind::stiff_string},
                         {"chain", ShapeKind::chain},
                         {"mesh", ShapeKind::mesh},
                         {"closedMesh", ShapeKind::closed_mesh},
                         {"cornerMesh", ShapeKind::corner_mesh},
                         {"triangle", ShapeKind::triangle},
                         {"hexagon", ShapeKind::hexagon}},
                        "shape")
      ->required();
  command
      ->add_option_function<std::vector<std::uint32_t>>(
          "N",
          [&shape](const std::vector<std::uint32_t>& sizes) {
            shape.length = sizes[0];
            shape.width = sizes.size() > 1 ? sizes[1] : 0;
          },
          "size; two of a mesh")
      ->required()
      ->expected(1, 2);
  command->add_option("--name", shape.name, "prefix of all labels: NAME_m0, NAME_K")
      ->capture_default_str();
  command->add_option("-M,--mass", shape.mass, "mass of every point, above 0")
      ->capture_default_str();
  command->add_option("-K,--stiffness", shape.stiffness, "stiffness of every link")
      ->capture_default_str();
  command->add_option("--K2", shape.second_stiffness, "stiffness of a stiffString's second springs")
      ->capture_default_str();
  command->add_option("-Z,--damping", shape.damping, "damping of every link")
      ->capture_default_str();
  command->add_option("--Zo", shape.air_damping, "damping of every point against the air")
      ->capture_default_str();
  command->add_option("--position", shape.position, "rest position of every point")
      ->capture_default_str();
  add_choice<FixedPoints>(*command, "--fixed", shape.fixed,
                          {{"corners", FixedPoints::corners},
                           {"border", FixedPoints::border},
                           {"none", FixedPoints::none}},
                          "fixed points of a triangle or a hexagon");
  command->add_flag("--macro", shape.as_macro, "write one line instead of all masses and links");
  command->add_flag_callback(
      "--bare", [&shape] { shape.with_io = false; },
      "omit the force input @in1 and the output @out1");
  add_output(*command, options.output, "output file (default: print)");
  add_overwrite(*command, options.force);
}

void add_export(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand("export", "exports a model to FAUST");
  command->footer(export_examples);
  ExportOptions& options = run_with<ExportOptions>(*command, code, export_to_faust);
  add_model(*command, options.name, "preset or model, by name or file")->required();
  command
      ->add_option_function<std::string>(
          "--to", [](const std::string&) {}, "target language")
      ->check(CLI::IsMember({"faust"}))
      ->required();
  add_output(*command, options.output, "output file (default: print)");
  add_overwrite(*command, options.force);
  add_no_rescale(*command, options.rescale);
  add_motion(*command, options.third);
}

void add_modes(CLI::App& app, int& code) {
  CLI::App* command =
      app.add_subcommand("modes", "computes frequency, decay, level and shape of a model's modes");
  command->footer(modes_examples);
  ModesOptions& options = run_with<ModesOptions>(*command, code, modes_command);
  add_model(*command, options.name, "preset or model, by name or file")->required();
  command
      ->add_option("--modes", options.count,
                   "number of modes, from the lowest (default: all of a small model)")
      ->check(CLI::Range(1, 10000));
  add_rate(*command, "--rate", options.rate_hz, 8000.0, 768000.0);
  command->add_flag("--exact", options.is_continuous,
                    "use the continuous network instead of the published scheme");
  command->add_flag("--json", options.as_json, "print JSON");
  add_output(*command, options.output, ".svg of the mode shapes; .mdl with --tune or --decay");
  command
      ->add_option("--tune", options.frequencies_hz,
                   "change the springs until the lowest modes have these frequencies")
      ->type_name("HZ,...")
      ->delimiter(',');
  command
      ->add_option_function<std::vector<std::string>>(
          "--decay",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) {
              options.decay.push_back(decay_point(text));
            }
          },
          "add dampers until modes at these frequencies have these T60")
      ->type_name("HZ:S,...")
      ->delimiter(',');
  add_overwrite(*command, options.force);
  add_motion(*command, options.third);
}

void add_chart(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand("chart", "plots the cost and the error of every method");
  command->footer(chart_examples);
  ChartOptions& options = run_with<ChartOptions>(*command, code, chart);
  command->add_option("MODEL", options.scenes, "reference scenes, presets or models")
      ->type_name("NAME");
  command->add_option("-o,--output", options.folder, "output folder")->type_name("DIR")->required();
  command->add_option("-t,--time", options.patience_s, "time for timing each scene, in s")
      ->check(within(0.1, 3600.0))
      ->capture_default_str();
}

void add_reference(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand("reference", "prints a table of the manual");
  std::vector<std::string> names;
  std::string footer = "PART:";
  for (const ReferencePart& known : reference_parts()) {
    names.emplace_back(known.name);
    footer += "\n  " + names.back() + std::string(12 - names.back().size(), ' ') +
              std::string(known.lists);
  }
  footer +=
      "\n  man         the manual page\n  completion  completion for bash\n"
      "  names       the names of all presets and models";
  command->footer(footer);
  names.insert(names.end(), {"man", "completion", "names"});
  std::string& part = run_with<std::string>(*command, code, [&app](const std::string& word) {
    return word == "man"          ? print_man(app)
           : word == "completion" ? print_completion(app)
           : word == "names"      ? print_names()
                                  : reference(word);
  });
  command->add_option("PART", part, "table to print")
      ->type_name("WORD")
      ->required()
      ->check(CLI::IsMember(names).description(""));
}

}  // namespace ressort::command_line
