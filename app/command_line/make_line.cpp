#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"

namespace ressort::command_line {
namespace {

const char* const make_examples =
    "KIND, and the points along each side, the fixed ones included:\n"
    "  string N         a row, both ends fixed    chain N          a row without fixed ends\n"
    "  stiffString N    with K2 to the next but one\n"
    "  mesh N N         a free rectangle          closedMesh N N   its border fixed\n"
    "  cornerMesh N N   its corners fixed\n"
    "  triangle N       N points a side: N(N+1)/2 points, 3N(N-1)/2 links\n"
    "  hexagon N        N rings around a point: 1+3N(N+1) points, 9N^2+3N links\n"
    "Numbers are per sample at 44100 Hz: a mass M on a spring K swings at 7000 sqrt(K/M) Hz. What\n"
    "nothing fixes is held by one more ground, so that a push does not send it away for good.\n"
    "Examples:\n"
    "  ressort make string 50 -o my.mdl            then: ressort play my.mdl\n"
    "  ressort make hexagon 6 --name drum -K 0.2   to be read, or pasted into a model\n"
    "  ressort make closedMesh 150 150 --macro     the same as one line\n";

}  // namespace

void add_make(CLI::App& app, MakeChoice& choice, int& code) {
  MakeOptions& options = choice.options;
  std::vector<std::uint32_t>& sizes = choice.sizes;
  Shape& shape = options.shape;
  CLI::App* command = app.add_subcommand("make", "writes a model: a string, a mesh, a triangle...");
  command->footer(make_examples);
  add_choice<ShapeKind>(*command, "KIND", shape.kind,
                        {{"string", ShapeKind::string},
                         {"stiffString", ShapeKind::stiff_string},
                         {"chain", ShapeKind::chain},
                         {"mesh", ShapeKind::mesh},
                         {"closedMesh", ShapeKind::closed_mesh},
                         {"cornerMesh", ShapeKind::corner_mesh},
                         {"triangle", ShapeKind::triangle},
                         {"hexagon", ShapeKind::hexagon}},
                        "of shape")
      ->required();
  command->add_option("N", sizes, "one size, or a mesh's two")->required()->expected(1, 2);
  command->add_option("--name", shape.name, "stands before every label: NAME_m0, NAME_K")
      ->capture_default_str();
  command->add_option("-M,--mass", shape.mass, "of every point, above 0")->capture_default_str();
  command->add_option("-K,--stiffness", shape.stiffness, "of every link, force per position")
      ->capture_default_str();
  command->add_option("--K2", shape.second_stiffness, "of a stiffString's second links")
      ->capture_default_str();
  command->add_option("-Z,--damping", shape.damping, "of every link, force per position a sample")
      ->capture_default_str();
  command->add_option("--Zo", shape.air_damping, "damping of every point against the air")
      ->capture_default_str();
  command->add_option("--position", shape.position, "where every point rests")
      ->capture_default_str();
  add_choice<FixedPoints>(*command, "--fixed", shape.fixed,
                          {{"corners", FixedPoints::corners},
                           {"border", FixedPoints::border},
                           {"none", FixedPoints::none}},
                          "what holds a triangle or hexagon");
  command->add_flag("--macro", shape.as_macro, "one line instead of every mass and link");
  command->add_flag_callback(
      "--bare", [&shape] { shape.with_io = false; },
      "without @in1, a force, and @out1, a position");
  command->add_option("-o,--output", options.output, "the file; without it, the screen");
  add_overwrite(*command, options.force);
  command->callback([&options, &sizes, &code] {
    options.shape.length = sizes[0];
    options.shape.width = sizes.size() > 1 ? sizes[1] : 0;
    code = make(options);
  });
}

}  // namespace ressort::command_line
