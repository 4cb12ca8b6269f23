#include "app/commands/body/solid.h"

#include <signal.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "app/commands/body/numbers.h"
#include "app/commands/body/shapes.h"
#include "app/commands/output.h"
#include "app/commands/progress_bar.h"
#include "app/exit_code.h"
#include "app/realtime/lockfree.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/model/language/tokens.h"
#include "core/ranges.h"
#include "core/solids/shell.h"

namespace ressort::commands {
namespace {

// Units of the model: 44100 steps per second, micrometres and newtons. A strike by hand then moves
// a body by about 1, and a kilogram is an M of 1944.81.
constexpr double m_per_kg = 44100.0 * 44100.0 * 1e-6;
constexpr int places_of_our_own = 4;
constexpr double very_large = 20.0;  // m

Flag called_off;  // set by the first Ctrl-C; the second ends the process

void watch_for_interrupt() {
  struct sigaction once {};
  once.sa_handler = [](int) { called_off.raise(); };
  once.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &once, nullptr);
  sigaction(SIGTERM, &once, nullptr);
}

std::string lower(std::string text) {
  for (char& c : text) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

// Makes a label of a file name.
std::string body_name(const std::string& file) {
  std::string name;
  for (const char c : std::filesystem::path(file).stem().string()) {
    const bool is_plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    name += is_plain ? c : '_';
  }
  const bool has_letter = !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) != 0;
  const bool is_taken = name == "in1" || name == "out1" || name == "out2";
  return has_letter && !is_taken ? name : "body" + (name.empty() ? "" : "_" + name);
}

std::string digits(double number, int significant) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", significant, number);
  return text;
}

struct MaterialChoice {
  SolidMaterial material;
  SolidDamping damping;
};

Result<MaterialChoice> choose_material(const SolidBodyOptions& options) {
  SolidMaterial material{};
  material.loss = 1e-3;
  if (!options.material.empty()) {
    const auto known = solid_material(lower(options.material));
    if (!known) {
      const auto names =
          mapped(solid_materials(), [](const SolidMaterial& row) { return std::string(row.name); });
      return Error{"unknown material '" + options.material + "'" +
                   did_you_mean(options.material, names) + "; known are " + joined(names, ", ")};
    }
    material = *known;
  } else if (!options.young || !options.poisson || !options.density) {
    return Error{
        "the material is missing; pass --material NAME, or --young, --poisson and --density"};
  }
  material.young = options.young.value_or(material.young);
  material.poisson = options.poisson.value_or(material.poisson);
  material.density = options.density.value_or(material.density);
  if (!(material.young > 0.0) || !(material.density > 0.0) || !(material.poisson > -1.0) ||
      !(material.poisson < 0.5)) {
    return Error{"--young and --density must be above 0, and --poisson above -1 and below 0.5"};
  }
  SolidDamping damping{.loss = options.loss.value_or(material.loss)};
  if (options.rayleigh) {
    damping = {(*options.rayleigh)[0], (*options.rayleigh)[1], 0.0};
  }
  if (damping.a < 0.0 || damping.b < 0.0 || damping.loss < 0.0 ||
      damping.a + damping.b + damping.loss <= 0.0) {
    return Error{
        "--loss must be above 0; the numbers of --rayleigh must not be negative, nor both 0"};
  }
  return MaterialChoice{material, damping};
}

// Reports what was changed in the surface.
void print_repairs(const std::string& file, const Repairs& repairs) {
  const auto percent = [](double share) { return digits(100.0 * share, 2) + " %"; };
  for (const auto& [count, said] :
       {std::pair(repairs.welded,
                  counted(repairs.welded, "point", "points") + " welded to another one"),
        std::pair(repairs.left_out, counted(repairs.left_out, "triangle", "triangles") +
                                        " left out: without area, or given twice"),
        std::pair(repairs.holes, counted(repairs.holes, "hole", "holes") +
                                     " closed; the edge of the longest has " +
                                     percent(repairs.longest_hole) + " of the size"),
        std::pair(repairs.turned,
                  counted(repairs.turned, "triangle", "triangles") + " turned to the other side"),
        std::pair(repairs.parts, counted(repairs.parts, "separate part", "separate parts") +
                                     " left out, with " + percent(repairs.parts_area) +
                                     " of the surface")}) {
    if (count > 0) {
      print_error(file + ": " + said);
    }
  }
}

// The mesh of a solid or shell, and its mesher.
struct Body {
  SolidMesh mesh;
  std::string by;
};

// Reads and meshes the file. Errors begin with its name.
Result<Body> read_body(const SolidBodyOptions& options, const Progress& progress,
                       const Progress::Callback& should_continue) {
  const auto located = [&](const Error& error) {
    return error.message == stopped
               ? error
               : Error{options.input +
                       (error.line > 0 ? ":" + std::to_string(error.line) : std::string()) +
                       ": error: " + error.message};
  };
  const auto bytes = read_bytes(options.input, max_solid_bytes);
  if (!bytes) {
    return bytes.error();
  }
  progress.stage("reading the solid");
  auto surface = read_surface(*bytes);
  if (!surface) {
    return located(surface.error());
  }
  if (surface->ignored_bytes > 0) {
    print_error("warning: " + options.input + ": ignored " +
                counted(surface->ignored_bytes, "byte", "bytes") + " behind the last triangle");
  }
  surface = scaled(*std::move(surface), options.scale);
  if (const double size = box_around(surface->points).diagonal(); size > very_large) {
    print_error("warning: the solid is " + digits(size, 3) +
                " m large; for a file in millimetres, pass --scale 0.001");
  }
  const auto report = [&](const Repairs& repairs) {
    if (!options.is_quiet) {
      print_repairs(options.input, repairs);
    }
  };
  if (options.thickness_mm > 0.0) {
    auto sheet = repaired_sheet(*surface, progress);
    if (!sheet) {
      return located(sheet.error());
    }
    report(sheet->repairs);
    progress.stage("meshing the shell");
    auto mesh = shell_mesh(std::move(sheet->surface), 1e-3 * options.thickness_mm,
                           options.mesh.unknowns, progress);
    if (!mesh) {
      return located(mesh.error());
    }
    return Body{*std::move(mesh), "ressort"};
  }
  const auto closed = close_surface(*surface, progress);
  if (!closed) {
    return located(
        Error{closed.error().message +
              "\nit is no solid; for a shell (a bowl, a bell, a sheet), pass --thickness "
              "with the thickness of its wall in mm"});
  }
  report(closed->repairs);
  const auto meshed = fill_with_tetrahedra(*closed, options.mesh, should_continue);
  if (!meshed) {
    return located(meshed.error());
  }
  if (!meshed->failures.empty()) {
    print_error("warning: meshed by " + meshed->by + ": " + meshed->failures);
  }
  auto mesh = quadratic(meshed->mesh);
  if (!mesh) {
    return located(mesh.error());
  }
  return Body{*std::move(mesh), meshed->by};
}

Result<std::vector<SolidPlace>> choose_places(const SolidBodyOptions& options,
                                              const std::vector<SolidClamp>& clamps,
                                              const SolidMesh& mesh) {
  const std::vector<Point3> normals = surface_normals(mesh);
  std::vector<SolidPlace> places;
  for (const PickedPlace& picked : options.places) {
    const int node = nearest_on_surface(mesh, options.scale * picked.point);
    const Point3 direction = picked.direction.value_or(normals[static_cast<std::size_t>(node)]);
    if (is_clamped(mesh.points[static_cast<std::size_t>(node)], clamps)) {
      return Error{"--place " + picked.name + " is clamped and cannot move"};
    }
    if (!(length(direction) > 0.0)) {
      return Error{"--place " + picked.name + ": the direction must not be 0"};
    }
    const bool is_taken = std::ranges::any_of(
        places, [&](const SolidPlace& other) { return other.name == picked.name; });
    if (is_taken) {
      return Error{"--place " + picked.name + " is defined twice"};
    }
    places.push_back({picked.name, node, 1.0 / length(direction) * direction});
  }
  if (places.empty()) {
    for (const int node : spread_on_surface(mesh, clamps, places_of_our_own)) {
      places.push_back(
          {"p" + std::to_string(places.size() + 1), node, normals[static_cast<std::size_t>(node)]});
    }
  }
  return places;
}

// Writes the body as a model. M of all modes is the mass of the body; weights are relative to a
// motion of the whole body.
std::string body_text(const std::string& name, const std::string& story, const SolidMesh& mesh,
                      const SolidModes& modes, const std::vector<SolidPlace>& places,
                      const SolidDamping& damping) {
  std::string text = story;
  for (const SolidPlace& place : places) {
    text += "# " + place.name + " is at " +
            to_string(mesh.points[static_cast<std::size_t>(place.node)]) + " m and moves along " +
            to_string(place.direction) + ".\n";
  }
  text += "@" + name + " body " + digits(modes.mass * m_per_kg, 9);
  for (const SolidPlace& place : places) {
    text += " " + place.name;
  }
  text += "\n";
  for (std::size_t k = 0; k < modes.frequency_hz.size(); ++k) {
    std::vector<double> weights;
    double most = 0.0;
    for (const SolidPlace& place : places) {
      weights.push_back(std::sqrt(modes.mass) * shape_at(modes, place, k));
      most = std::abs(weights.back()) > std::abs(most) ? weights.back() : most;
    }
    text += "@" + name + "_" + std::to_string(k + 1) + " mode @" + name + " " +
            digits(modes.frequency_hz[k], 8) + " " +
            digits(damping.t60_s(modes.frequency_hz[k]), 6);
    for (const double weight : weights) {
      text += " " + digits(most < 0.0 ? -weight : weight, 6);
    }
    text += "\n";
  }
  text += "@in1 frcInput [@" + name + " " + places.front().name + "]\n";
  for (std::size_t i = 0; i < 2; ++i) {
    text += "@out" + std::to_string(i + 1) + " posOutput [@" + name + " " +
            places[std::min(i, places.size() - 1)].name + "]\n";
  }
  return text;
}

std::string header_comment(const SolidBodyOptions& options, const MaterialChoice& choice,
                           const SolidMesh& mesh, const SolidModes& modes, const std::string& by) {
  const SolidMaterial& material = choice.material;
  const std::string what = material.name.empty() ? "" : std::string(material.name) + ", ";
  const std::string loss = options.rayleigh ? "Rayleigh damping " + digits(choice.damping.a, 4) +
                                                  " 1/s, " + digits(choice.damping.b, 4) + " s"
                                            : "loss factor " + digits(choice.damping.loss, 4);
  const std::string elements =
      mesh.thickness > 0.0 ? std::to_string(mesh.surface.size()) + " flat triangles of a shell, " +
                                 digits(options.thickness_mm, 4) + " mm thick,"
                           : std::to_string(mesh.elements.size()) + " quadratic tetrahedra";
  return "# " + std::filesystem::path(options.input).filename().string() + ": " +
         digits(modes.mass, 4) + " kg of " + what + digits(material.young, 4) + " Pa, " +
         digits(material.poisson, 4) + ", " + digits(material.density, 4) + " kg/m^3; " + loss +
         "; " + (options.clamps.empty() ? "free" : "clamped") +
         ".\n# Finite elements: " + elements + " by " + by + ", " +
         std::to_string(mesh.unknowns()) + " unknowns, residual " + digits(modes.residual, 2) +
         ".\n# Units: micrometres and newtons; M is kilograms times 1e-6 (44100/s)^2, and K "
         "newtons per\n"
         "# micrometre. A mode has its frequency in Hz, its T60 in s, and the displacement of each "
         "place\n"
         "# relative to a motion of the whole body.\n";
}

}  // namespace

Result<PickedPlace> parse_place(const std::string& text) {
  const std::size_t equals = text.find('=');
  const auto numbers =
      equals == std::string::npos ? std::nullopt : numbers_of(text.substr(equals + 1));
  if (!numbers || (numbers->size() != 3 && numbers->size() != 6) ||
      !is_identifier(text.substr(0, equals))) {
    return Error{"expected NAME=X,Y,Z, or with a direction NAME=X,Y,Z,DX,DY,DZ, found '" + text +
                 "'"};
  }
  const std::vector<double>& n = *numbers;
  PickedPlace place{text.substr(0, equals), {n[0], n[1], n[2]}, std::nullopt};
  if (n.size() == 6) {
    place.direction = Point3{n[3], n[4], n[5]};
  }
  return place;
}

Result<SolidClamp> parse_clamp(const std::string& text) {
  const auto numbers = numbers_of(text);
  if (!numbers || numbers->size() != 4 || (*numbers)[3] < 0.0) {
    return Error{"expected X,Y,Z,R: the middle of a ball and its radius, found '" + text + "'"};
  }
  return SolidClamp{{(*numbers)[0], (*numbers)[1], (*numbers)[2]}, (*numbers)[3]};
}

std::vector<std::vector<std::string>> material_table() {
  std::vector<std::vector<std::string>> rows = {
      {"material", "E, GPa", "nu", "density, kg/m^3", "loss factor"}};
  for (const SolidMaterial& row : solid_materials()) {
    rows.push_back({std::string(row.name), digits(row.young * 1e-9, 4), digits(row.poisson, 4),
                    digits(row.density, 5), digits(row.loss, 3)});
  }
  return rows;
}

int solid_body(const SolidBodyOptions& options) {
  const auto choice = choose_material(options);
  if (!choice) {
    return reject(choice.error().message);
  }
  for (const std::string& written : {options.output, options.picture}) {
    const std::string read[] = {options.input};
    if (const auto spared = check_not_input(written, read); !spared) {
      return reject(spared.error().message);
    }
  }
  watch_for_interrupt();
  ProgressBar bar(!options.is_quiet);
  const Progress::Callback should_continue = [&](std::string_view stage) {
    bar.show(stage == "finding its modes"   ? 0.6
             : stage == "reading the solid" ? 0.0
             : stage.starts_with("meshing") ? 0.1
                                            : 0.3,
             std::string(stage));
    return !called_off.is_raised();
  };
  const Progress progress(should_continue);
  // Reports an error or the interruption. No file has been written in that case.
  const auto failed = [&](const Error& error) {
    if (error.message == stopped) {
      std::fprintf(stderr, "%s: interrupted\n", options.input.c_str());
      return exit_code::our_failure;
    }
    return reject(error.message);
  };
  try {
    const auto body = read_body(options, progress, should_continue);
    if (!body) {
      return failed(body.error());
    }
    const SolidMesh* const mesh = &body->mesh;
    std::vector<SolidClamp> clamps;
    for (const SolidClamp& clamp : options.clamps) {
      clamps.push_back({options.scale * clamp.centre, options.scale * clamp.radius});
    }
    const auto places = choose_places(options, clamps, *mesh);
    if (!places) {
      return failed(places.error());
    }
    const auto modes = find_solid_modes(*mesh, choice->material, clamps, options.modes, progress);
    if (!modes) {
      return failed(Error{options.input + ": error: " + modes.error().message});
    }
    const std::string header = header_comment(options, *choice, *mesh, *modes, body->by);
    const std::string text =
        body_text(body_name(options.input), header, *mesh, *modes, *places, choice->damping);
    if (!options.picture.empty()) {
      const std::string title = std::filesystem::path(options.input).filename().string() + ", " +
                                digits(modes->mass, 4) + " kg";
      if (const int failure = put_figure(
              options.picture, shapes_figure(*mesh, *modes, *places, title), options.force)) {
        return failure;
      }
    }
    if (options.output.empty()) {
      std::fwrite(text.data(), 1, text.size(), stdout);
      return exit_code::done;
    }
    if (const int failure = write_output(options.output, text, options.force)) {
      return failure;
    }
    if (!options.is_quiet) {
      std::printf("%s: %s from %s to %s Hz, %s kg, %zu unknowns, residual %s\n",
                  options.output.c_str(),
                  counted(modes->frequency_hz.size(), "mode", "modes").c_str(),
                  digits(modes->frequency_hz.front(), 6).c_str(),
                  digits(modes->frequency_hz.back(), 6).c_str(), digits(modes->mass, 4).c_str(),
                  mesh->unknowns(), digits(modes->residual, 2).c_str());
    }
    return exit_code::done;
  } catch (const Stopped&) {
    return failed(Error{stopped});
  }
}

}  // namespace ressort::commands
