#include <algorithm>
#include <cctype>
#include <string>
#include <utility>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/commands/body/body.h"

namespace ressort::command_line {
namespace {

const char* const examples =
    "--statistical makes a body without a file: a soundboard, box or room whose modes have a "
    "density,\n"
    "a loss and random shapes. A bridge (in1) drives it, and left and right (out1, out2) hear "
    "it.\n"
    "Curves are straight between their points over the logarithm of the frequency.\n"
    "FILE is one of:\n"
    "- a recording of one object, struck once (.wav, .flac, .ogg, .aiff, ...). The body has its "
    "modes, the\n"
    "  place `hit`, and a place for each channel: `mic`, `left` and `right`, or `mic1` and so on.\n"
    "- the surface of a solid (.stl, .obj, .ply, .off), or with --thickness of a shell. Finite "
    "elements find\n"
    "  its modes. ressort meshes boxes, balls and shells itself; other solids need gmsh or "
    "tetgen.\n"
    "- a resonance model: a text with the frequency, amplitude and bandwidth of each mode.\n"
    "- a model (.mdl). The body has its modes, with its inputs and outputs as places. With --chain "
    "it\n"
    "  becomes a chain of masses and springs with the same response at one place.\n"
    "Examples:\n"
    "  ressort body bowl.wav -o bowl.mdl --modes 20 --picture bowl.svg\n"
    "  ressort body tom.wav -o Tom.toml     # a preset with its model, Tom.mdl, and its noise\n"
    "  ressort body soft.wav loud.wav -o Tom.toml     # velocity goes from the first to the last\n"
    "  ressort body bell.stl --material bronze --scale 0.001 --place rim=150,0,0 -o bell.mdl\n"
    "  ressort body gong.obj --material bronze --scale 0.001 --thickness 1.2 -o gong.mdl\n"
    "  ressort body bar.obj --young 11e9 --poisson 0.25 --density 750 --loss 0.01 -o bar.mdl\n"
    "  ressort body drum.mdl -o drum_body.mdl\n"
    "  ressort body bell.mdl --chain rim -o chain.mdl\n"
    "  ressort body --statistical 300:0.03,5000:0.03 --loss 0.02 --mode 100,20 --mode 190,30 -o "
    "box.mdl\n";

void add_recording(CLI::App& command, BodyOptions& options) {
  command
      .add_option("--floor", options.floor_db,
                  "omit modes whose energy is further below the strongest mode")
      ->type_name("DB")
      ->check(within(-200.0, 0.0))
      ->capture_default_str();
  command
      .add_option("--listen", options.listen,
                  "folder for WAV files of the recording, its modes, its noise and their sum")
      ->type_name("DIR");
  command.add_flag("--json", options.as_json, "print JSON");
}

void add_solid(CLI::App& command, SolidBodyOptions& options) {
  command
      .add_option("--material", options.material,
                  "material; 'ressort reference materials' lists all")
      ->type_name("WORD");
  command.add_option("--young", options.young, "Young's modulus")->type_name("PA");
  command.add_option("--poisson", options.poisson, "Poisson's ratio");
  command.add_option("--density", options.density, "density in kg/m^3");
  command
      .add_option("--rayleigh", options.rayleigh,
                  "Rayleigh damping in 1/s and s: T60 = 13.8 / (A + B (2 pi frequency)^2)")
      ->type_name("A,B")
      ->delimiter(',')
      ->excludes("--loss");
  command
      .add_option("--scale", options.scale, "metres per unit of the file; 0.001 for millimetres")
      ->check(within(1e-9, 1e9))
      ->capture_default_str();
  command
      .add_option("--thickness", options.thickness_mm,
                  "the surface, open or closed, is the middle of a wall of this thickness")
      ->type_name("MM")
      ->check(within(1e-6, 1e6));
  add_parsed(command, "--place", options.places, parse_place,
             "place: NAME=X,Y,Z or NAME=X,Y,Z,DX,DY,DZ in the file's unit (default: four)");
  add_parsed(command, "--clamp", options.clamps, parse_clamp,
             "ball that is held still: X,Y,Z,R in the file's unit");
  add_choice<Mesher>(command, "--mesher", options.mesh.mesher,
                     {{"auto", Mesher::automatic},
                      {"own", Mesher::own},
                      {"gmsh", Mesher::gmsh},
                      {"tetgen", Mesher::tetgen}},
                     "mesher");
  command
      .add_option("--unknowns", options.mesh.unknowns,
                  "approximate number of unknowns; more are more accurate and slower")
      ->check(within(200, 1'000'000))
      ->capture_default_str();
  command.add_flag("-q,--quiet", options.is_quiet, "print errors only");
}

// An option with a curve over frequency, or one value for all frequencies.
CLI::Option* add_curve(CLI::App& command, const std::string& name, std::vector<CurvePoint>& target,
                       double least, double most, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [&target, name, least, most](const std::string& text) {
            auto curve = parse_curve(text, least, most);
            if (!curve) {
              throw CLI::ValidationError(name, curve.error().message);
            }
            target = *std::move(curve);
          },
          help)
      ->type_name("HZ:VALUE,...");
}

void add_statistics(CLI::App& command, BodyStatistics& statistics) {
  CLI::Option* density =
      add_curve(command, "--statistical", statistics.density, 1e-9, 1e3,
                "density of the modes in modes/Hz, from the lowest to the highest frequency");
  add_parsed(command, "--mode", statistics.given, parse_mode,
             "known mode: HZ,Q[,BRIDGE[,LEFT[,RIGHT]]]; displacements relative to the rms of the "
             "drawn modes (default 1; RIGHT as LEFT)")
      ->needs(density);
  add_curve(command, "--radiation", statistics.radiation, -200.0, 200.0,
            "level of the outputs in dB over frequency")
      ->needs(density);
  command.add_option("--seed", statistics.seed, "equal numbers draw equal modes")
      ->check(within(0.0, 1e9))
      ->capture_default_str()
      ->needs(density);
}

// Returns the given options that only some inputs use, with the input of their group.
auto particular_options(const CLI::App& command) {
  std::vector<std::pair<std::string, std::string>> given;
  for (const CLI::Option* option : command.get_options()) {
    std::string group = option->get_group();
    std::ranges::transform(group, group.begin(), ::tolower);
    const bool is_common = option->check_name("FILE") || option->check_name("--output") ||
                           option->check_name("--force");
    if (option->count() > 0 && !is_common) {
      given.emplace_back(option->get_name(), group);
    }
  }
  return given;
}

}  // namespace

void add_body(CLI::App& app, int& code) {
  CLI::App* command = app.add_subcommand(
      "body", "makes a modal body from a recording, a solid, a model or statistics");
  command->footer(examples);
  BodyRequest& request = run_with<BodyRequest>(*command, code, [command](const auto& chosen) {
    const bool is_statistical = !chosen.statistical.statistics.density.empty();
    if (!is_statistical && chosen.input.empty()) {
      throw CLI::RequiredError("FILE or --statistical");
    }
    if (is_statistical && !chosen.input.empty()) {
      throw CLI::ExcludesError("FILE", "--statistical");
    }
    BodyRequest request = chosen;
    request.particular = particular_options(*command);
    return body_command(request);
  });
  command->add_option("FILE", request.input, "recording, solid or model")->type_name("PATH");
  add_output(*command, request.output, "model to write (default: print)");
  command
      ->add_option("--picture", request.picture,
                   ".svg of a recording and its body, or of the mode shapes of a solid")
      ->type_name("FILE");
  command
      ->add_option(
          "--modes", request.modes,
          "number of modes (default: at most 150 of a recording, 400 of statistics, 40 of a "
          "solid; all of a model)")
      ->check(within(1, 2000));
  command
      ->add_option("-M,--mass", request.mass,
                   "mass of every mode of a recording; mass of a statistical body")
      ->check(within(1e-9, 1e9))
      ->capture_default_str();
  add_curve(*command, "--loss", request.loss, 1e-9, 1.0,
            "loss factor: T60 = 2.2 / (LOSS * frequency); a curve only for a statistical body");
  add_overwrite(*command, request.force);
  command->option_defaults()->group("Recording");
  command
      ->add_option("OTHERS", request.recording.others,
                   "more recordings of the same object: harder blows, other places")
      ->type_name("PATH");
  add_recording(*command, request.recording);
  command->option_defaults()->group("Solid");
  add_solid(*command, request.solid);
  command->option_defaults()->group("Model");
  command->add_option("--chain", request.network.chain, "place whose response the chain has")
      ->type_name("PLACE");
  command->option_defaults()->group("Statistics");
  add_statistics(*command, request.statistical.statistics);
}

}  // namespace ressort::command_line
