#include <string>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"
#include "app/text.h"
#include "core/solids/solid_modes.h"

namespace ressort::command_line {
namespace {

const char* const examples =
    "FILE is what the body is made of, told by its ending:\n"
    "- a recording of one thing that was struck once (.wav, .flac, .ogg, .aiff, ...). What rings "
    "in\n"
    "  it is found as modes, with how uncertain their numbers are. The body has the place `hit` "
    "and\n"
    "  one for each channel: `mic`, `left` and `right`, or `mic1` and so on.\n"
    "- a solid, its surface as .stl or .obj. Its modes are found by finite elements. Boxes and "
    "balls\n"
    "  are cut up by ressort itself, all else by gmsh or tetgen, whichever is installed.\n"
    "- a model (.mdl): its own modes, with its inputs and outputs as places; with --chain masses "
    "and\n"
    "  springs in a row that answer at one of them as it does.\n"
    "Examples:\n"
    "  ressort body bowl.wav -o bowl.mdl --modes 20 --picture bowl.svg\n"
    "  ressort body bell.stl --material bronze --scale 0.001 --place rim=150,0,0 -o bell.mdl\n"
    "  ressort body bar.obj --young 11e9 --poisson 0.25 --density 750 --loss 0.01 -o bar.mdl\n"
    "  ressort body drum.mdl -o drum_body.mdl\n"
    "  ressort body bell.mdl --chain rim -o chain.mdl\n";

void add_recording(CLI::App& command, BodyOptions& options) {
  command
      .add_option("--floor", options.floor_db,
                  "dB: modes whose energy is so far below the first's are left out")
      ->check(within(-200.0, 0.0))
      ->capture_default_str();
  command.add_option("-M,--mass", options.mass, "of every mode, above 0")
      ->check(within(1e-9, 1e9))
      ->capture_default_str();
  command.add_flag("--json", options.as_json, "all that was found, for machines");
}

void add_solid(CLI::App& command, SolidBodyOptions& options) {
  std::vector<std::string> materials;
  for (const SolidMaterial& material : solid_materials()) {
    materials.emplace_back(material.name);
  }
  command.add_option("--material", options.material, "what it is of: " + joined(materials, ", "));
  command.add_option("--young", options.young, "Young's modulus in Pa, instead of the material's");
  command.add_option("--poisson", options.poisson, "Poisson's ratio");
  command.add_option("--density", options.density, "kg/m^3");
  CLI::Option* loss =
      command.add_option("--loss", options.loss, "loss factor: T60 is 2.2/(LOSS * frequency)");
  command
      .add_option("--rayleigh", options.rayleigh,
                  "A,B in 1/s and s: T60 is 13.8/(A + B (2 pi frequency)^2)")
      ->delimiter(',')
      ->excludes(loss);
  command
      .add_option("--scale", options.scale, "metres per unit of the file; 0.001 for millimetres")
      ->check(within(1e-9, 1e9))
      ->capture_default_str();
  add_parsed(command, "--place", options.places, parse_place,
             "NAME=X,Y,Z in the file's unit: the nearest point of the surface, touched along its\n"
             "normal, or along NAME=X,Y,Z,DX,DY,DZ; may stand several times. Without it p1 to p4,\n"
             "far from each other");
  add_parsed(command, "--clamp", options.clamps, parse_clamp,
             "X,Y,Z,R in the file's unit: what lies in this ball is held; may stand several times");
  add_choice<Mesher>(command, "--mesher", options.mesh.mesher,
                     {{"auto", Mesher::automatic},
                      {"own", Mesher::own},
                      {"gmsh", Mesher::gmsh},
                      {"tetgen", Mesher::tetgen}},
                     "what fills it with tetrahedra");
  command
      .add_option("--unknowns", options.mesh.unknowns,
                  "about how many; more are nearer to the solid and take longer")
      ->check(within(200, 1'000'000))
      ->capture_default_str();
  command.add_flag("-q,--quiet", options.is_quiet, "say nothing unless something is wrong");
}

}  // namespace

void add_body(CLI::App& app, BodyRequest& request, int& code) {
  CLI::App* command = app.add_subcommand(
      "body", "makes a body that can be struck of a recording, of a solid, or of another model");
  command->footer(examples);
  command->add_option("FILE", request.input, "a recording, a solid or a model")->required();
  command->add_option("-o,--output", request.output, "the model; without it, the screen");
  command->add_option("--picture", request.picture,
                      "an .svg of what was found: a recording's spectrum with the modes, or the\n"
                      "lowest shapes of a solid");
  command
      ->add_option("--modes", request.modes,
                   "at most so many: of a recording those with most energy (400), else the lowest\n"
                   "(40 of a solid, all of a model)")
      ->check(within(1, 2000));
  add_overwrite(*command, request.force);
  command->option_defaults()->group("Of a recording");
  add_recording(*command, request.recording);
  command->option_defaults()->group("Of a solid");
  add_solid(*command, request.solid);
  command->option_defaults()->group("Of a model");
  command->add_option("--chain", request.network.chain,
                      "a place: masses and springs in a row that answer there as the model does");
  command->callback([&request, &code] { code = body_command(request); });
}

}  // namespace ressort::command_line
