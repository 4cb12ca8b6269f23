#include "app/commands/body/solid.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "app/commands/body/shapes.h"
#include "app/session/files.h"
#include "tests/support/catch.h"
#include "tests/support/player.h"
#include "tests/support/ringing.h"
#include "tests/support/solids.h"
#include "tests/support/thorough.h"

namespace ressort::solid_body_test {
namespace {

using namespace support;
namespace fs = std::filesystem;

constexpr double pi = std::numbers::pi;

// A temporary folder with solids.
class Workshop {
 public:
  Workshop() {
    std::string name = (fs::temp_directory_path() / "ressort-test-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    folder_ = name;
  }
  ~Workshop() { fs::remove_all(folder_); }
  std::string put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return file(name);
  }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

 private:
  fs::path folder_;
};

struct WrittenMode {
  double frequency_hz = 0.0;
  double t60_s = 0.0;
  std::vector<double> weights;
};
struct WrittenBody {
  double m = 0.0;
  std::vector<std::string> places;
  std::vector<WrittenMode> modes;
};

// Parsed lines of the model: "@NAME body M PLACE..." and "@NAME mode @BODY HZ T60 W...".
WrittenBody read_body(const std::string& file) {
  WrittenBody body;
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    std::string keyword;
    std::string word;
    words >> name >> keyword;
    if (keyword == "body") {
      words >> body.m;
      while (words >> word) {
        body.places.push_back(word);
      }
    } else if (keyword == "mode") {
      WrittenMode mode;
      words >> word >> mode.frequency_hz >> mode.t60_s;
      for (double weight = 0.0; words >> weight;) {
        mode.weights.push_back(weight);
      }
      body.modes.push_back(mode);
    }
  }
  return body;
}

bool is_there(const char* program) {
  return std::system(("command -v " + std::string(program) + " >/dev/null 2>&1").c_str()) == 0;
}

TEST_CASE("A bar becomes a body that moves like a beam", "[solid_body]") {
  const Workshop workshop;
  SolidBodyOptions options{
      .input = workshop.put("bar.stl", ascii_stl(box_surface({200, 20, 10}))),
      .output = workshop.file("bar.mdl"),
      .is_quiet = true,
      .young = 2e11,
      .poisson = 0.3,
      .density = 7850.0,
      .scale = 0.001,
      .modes = 6,
      .places = {{"end", {0, 20, 10}, Point3{0, 0, 1}}, {"middle", {100, 20, 10}, Point3{0, 0, 2}}},
      .rayleigh = std::array<double, 2>{5.0, 3e-8}};
  options.mesh.unknowns = 11000;
  options.picture = workshop.file("bar.svg");
  REQUIRE(solid_body(options) == 0);
  const WrittenBody body = read_body(options.output);
  // 0.314 kg in units of micrometres and newtons at 44100 steps a second.
  CHECK(body.m == Approx(0.314 * 44100.0 * 44100.0 * 1e-6).epsilon(1e-8));
  CHECK(body.places == std::vector<std::string>{"end", "middle"});
  REQUIRE(body.modes.size() == 6);
  CHECK(body.modes[0].frequency_hz == Approx(1285.95).epsilon(1e-3));  // T-BAR
  // a = 5, b = 3e-8.
  const double omega = 2.0 * pi * body.modes[0].frequency_hz;
  CHECK(body.modes[0].t60_s == Approx(2.0 * std::log(1000.0) / (5.0 + 3e-8 * omega * omega)));
  // A thin beam has phi_end^2 m = 4 and phi_mid / phi_end = -0.6079 (T-GAIN). The thickness of this
  // beam is a twentieth of its length, which changes both by a few percent.
  REQUIRE(body.modes[0].weights.size() == 2);
  CHECK(std::abs(body.modes[0].weights[0]) == Approx(2.0).epsilon(0.03));
  CHECK(body.modes[0].weights[1] / body.modes[0].weights[0] == Approx(-0.6079).epsilon(0.05));
  CHECK(read_text(options.picture, 1 << 24)->find("1: 1286") != std::string::npos);
}

TEST_CASE("A sheet with a thickness becomes a body", "[solid_body]") {
  const Workshop workshop;
  SolidBodyOptions options{
      .input = workshop.put("sheet.obj", "v 0 0 0\nv 20 0 0\nv 20 20 0\nv 0 20 0\nf 1 2 3 4\n"),
      .output = workshop.file("sheet.mdl"),
      .is_quiet = true,
      .young = 2e11,
      .poisson = 0.3,
      .density = 7850.0,
      .scale = 0.01,
      .thickness_mm = 1.0,
      .modes = 5,
      .places = {{"corner", {0, 0, 0}, std::nullopt}, {"middle", {10, 10, 0}, std::nullopt}},
      .loss = 0.001};
  options.mesh.unknowns = 6000;
  options.picture = workshop.file("sheet.svg");
  REQUIRE(solid_body(options) == 0);
  const WrittenBody body = read_body(options.output);
  CHECK(body.m == Approx(0.314 * 44100.0 * 44100.0 * 1e-6).epsilon(1e-8));
  REQUIRE(body.modes.size() == 5);
  // A free square plate has lambda^2 = 13.468, 19.596, 24.270 and twice 34.801 (Liew, Xiang and
  // Kitipornchai 1995).
  const double unit = 1e-3 / (2.0 * pi * 0.04) * std::sqrt(2e11 / (12.0 * 7850.0 * (1.0 - 0.09)));
  const double wanted[] = {13.468, 19.596, 24.270, 34.801, 34.801};
  for (std::size_t k = 0; k < 5; ++k) {
    CHECK(body.modes[k].frequency_hz == Approx(wanted[k] * unit).epsilon(0.01));
  }
  // The first mode twists the sheet about its resting middle; the third is a bowl.
  CHECK(std::abs(body.modes[0].weights[1]) < 0.01 * std::abs(body.modes[0].weights[0]));
  CHECK(body.modes[2].weights[1] < -0.5 * body.modes[2].weights[0]);
  CHECK(fs::exists(options.picture));
}

TEST_CASE("A recording of a struck bar has the modes of its solid", "[solid_body]") {
  // ME-T9 requires 0.01 Hz and 0.1 %.
  const Workshop workshop;
  SolidBodyOptions options{
      .input = workshop.put("bar.stl", ascii_stl(box_surface({200, 20, 10}))),
      .output = workshop.file("bar.mdl"),
      .is_quiet = true,
      .material = "steel",
      .scale = 0.001,
      .modes = 10,
      .places = {{"end", {0, 20, 10}, std::nullopt}, {"side", {60, 0, 10}, Point3{0, 1, 1}}},
      .rayleigh = std::array<double, 2>{8.0, 1e-8}};
  options.mesh.unknowns = 4000;
  REQUIRE(solid_body(options) == 0);
  const WrittenBody body = read_body(options.output);
  const std::string text = *read_text(options.output, 1 << 20);
  Player player(text, default_preset(network_of(text), true), {.bare = true});  // struck at its end
  std::vector<double> blow(3 * 44100);
  blow[0] = 1.0;
  const double* const input = blow.data();
  player.run(blow.size(), {}, {256}, std::span(&input, 1));
  const Identification found = identified({player.out[1]}, 44100.0, {.floor_db = -120.0});
  REQUIRE(body.modes.size() == 10);
  REQUIRE(found.modes.size() == body.modes.size());
  for (std::size_t k = 0; k < body.modes.size(); ++k) {
    INFO(body.modes[k].frequency_hz << " Hz");
    CHECK(std::abs(found.modes[k].frequency_hz.value - body.modes[k].frequency_hz) < 1e-4);
    CHECK(found.modes[k].t60_s.value == Approx(body.modes[k].t60_s).epsilon(1e-4));
  }
}

TEST_CASE("A ball from an STL file has the frequencies of Lamb with every mesher", "[solid_body]") {
  // ME-T3: eta = omega R sqrt(rho / G) at nu = 0.3, multiplicities 5, 5, 3, 7, 7. G = 1 GPa, R =
  // 0.1.
  const Workshop workshop;
  const std::string ball = workshop.put("ball.stl", binary_stl(icosphere(3, 0.1, true)));
  struct Program {
    Mesher mesher;
    const char* name;
    double unknowns;
  };
  for (const Program& program :
       {Program{Mesher::own, "true", 28000.0}, Program{Mesher::gmsh, "gmsh", 15000.0},
        Program{Mesher::tetgen, "tetgen", 15000.0}}) {
    if (program.mesher != Mesher::own && !support::is_thorough()) {
      continue;
    }
    if (!is_there(program.name)) {
      WARN("skipped: " << program.name << " is not installed");
      continue;
    }
    SolidBodyOptions options{.input = ball,
                             .output = workshop.file("ball.mdl"),
                             .force = true,
                             .is_quiet = true,
                             .young = 2.6e9,
                             .poisson = 0.3,
                             .density = 1000.0,
                             .modes = 27,
                             .mesh = {.mesher = program.mesher, .unknowns = program.unknowns}};
    INFO(program.name);
    REQUIRE(solid_body(options) == 0);
    const WrittenBody body = read_body(options.output);
    REQUIRE(body.modes.size() == 27);
    std::size_t next = 0;
    for (const auto& [eta, count] :
         {std::pair(2.50113, 5), {2.64622, 5}, {3.52999, 3}, {3.86470, 7}, {3.93740, 7}}) {
      for (int i = 0; i < count; ++i) {
        CHECK(2.0 * pi * 0.1 * 1e-3 * body.modes[next++].frequency_hz == Approx(eta).epsilon(3e-3));
      }
    }
  }
}

TEST_CASE("Both meshers agree on a bowl and on a hollow solid", "[solid_body]") {
  if (!is_there("gmsh") || !is_there("tetgen")) {
    WARN("skipped: gmsh or tetgen is not installed");
    return;
  }
  const Workshop workshop;
  Surface hollow = icosphere(2, 0.1, true);
  append(hollow, icosphere(2, 0.06, true));
  std::vector<std::array<double, 2>> profile;
  for (int i = 0; i <= 24; ++i) {
    const double angle = 0.5 * pi * i / 24;
    profile.push_back({i == 0 ? 0.0 : 0.08 * std::sin(angle), -0.08 * std::cos(angle)});
  }
  for (int i = 24; i >= 0; --i) {
    const double angle = 0.5 * pi * i / 24;
    profile.push_back({i == 0 ? 0.0 : 0.074 * std::sin(angle), -0.074 * std::cos(angle)});
  }
  std::vector<Surface> solids = {hollow};
  if (support::is_thorough()) {
    solids.push_back(revolved(profile, 48));  // meshing takes a quarter of a minute
  }
  for (const Surface& solid : solids) {
    std::vector<WrittenBody> bodies;
    for (const Mesher mesher : {Mesher::gmsh, Mesher::tetgen}) {
      SolidBodyOptions options{.input = workshop.put("solid.obj", obj(solid)),
                               .output = workshop.file("solid.mdl"),
                               .force = true,
                               .is_quiet = true,
                               .material = "bronze",
                               .modes = 8,
                               .mesh = {.mesher = mesher, .unknowns = 12000}};
      REQUIRE(solid_body(options) == 0);
      bodies.push_back(read_body(options.output));
    }
    CHECK(bodies[0].m == Approx(bodies[1].m).epsilon(1e-6));
    // Gmsh remeshes round surfaces, TetGen preserves them.
    for (std::size_t i = 0; i < 8; ++i) {
      CHECK(bodies[0].modes[i].frequency_hz ==
            Approx(bodies[1].modes[i].frequency_hz).epsilon(1.5e-2));
    }
  }
}

TEST_CASE("Wrong solids and wrong options end with exit code 2", "[solid_body]") {
  const Workshop workshop;
  Surface open = box_surface({1, 1, 1});
  open.triangles.pop_back();
  SolidBodyOptions options{.input = workshop.put("open.stl", ascii_stl(open)),
                           .output = workshop.file("open.mdl"),
                           .is_quiet = true,
                           .material = "steel"};
  CHECK(solid_body(options) == 2);
  CHECK_FALSE(fs::exists(options.output));
  options.input = workshop.file("nothing.stl");
  CHECK(solid_body(options) == 2);
  options.input = workshop.put("box.stl", ascii_stl(box_surface({1, 1, 1})));
  options.mesh.unknowns = 500;
  for (const auto& spoil : std::vector<std::function<void(SolidBodyOptions&)>>{
           [](auto& o) { o.material = "cheese"; }, [](auto& o) { o.material = ""; },
           [](auto& o) { o.poisson = 0.5; }, [](auto& o) { o.young = 0.0; },
           [](auto& o) { o.density = -1.0; }, [](auto& o) { o.loss = 0.0; },
           [](auto& o) {
             o.rayleigh = std::array<double, 2>{-1.0, 0.0};
           },
           [](auto& o) {
             o.places = {{"a", {}, Point3{}}};
           },
           [](auto& o) {
             o.places = {{"a", {}, {}}, {"a", {}, {}}};
           },
           [](auto& o) {
             o.clamps = {{{}, 10.0}};
           },
           [](auto& o) { o.output = o.input; }}) {
    SolidBodyOptions spoilt = options;
    spoil(spoilt);
    CHECK(solid_body(spoilt) == 2);
  }
  CHECK(solid_body(options) == 0);
  CHECK(solid_body(options) == 2);  // the file exists
}

TEST_CASE("A missing mesher gives advice, and a hanging mesher is stopped", "[solid_body]") {
  const auto solid = close_surface(icosphere(1, 1.0, false), Progress());
  REQUIRE(solid);
  auto bent = *solid;
  bent.surface.points[0] = 1.5 * bent.surface.points[0];
  const Workshop workshop;
  const std::string path = std::getenv("PATH");
  const auto with_path = [&](const std::string& folders, const MeshOrder& order,
                             const Progress::Callback& should_continue) {
    setenv("PATH", folders.c_str(), 1);
    auto meshed = fill_with_tetrahedra(bent, order, should_continue);
    setenv("PATH", path.c_str(), 1);
    return meshed;
  };
  const auto yes = [](std::string_view) { return true; };
  const auto without = with_path(workshop.file(""), {}, yes);
  REQUIRE_FALSE(without);
  CHECK(without.error().message.find("install the package gmsh") != std::string::npos);

  const std::string program = workshop.put("tetgen", "#!/bin/sh\nexec sleep 60\n");
  fs::permissions(program, fs::perms::owner_all);
  const std::string folders = workshop.file("") + ":/usr/bin:/bin";
  const auto late = with_path(folders, {.mesher = Mesher::tetgen, .limit_s = 0.1}, yes);
  REQUIRE_FALSE(late);
  CHECK(late.error().message.find("was stopped after 0.1 s") != std::string::npos);
  // A grid follows if every program is late.
  workshop.put("gmsh", "#!/bin/sh\nexec sleep 60\n");
  fs::permissions(workshop.file("gmsh"), fs::perms::owner_all);
  const auto gridded = with_path(folders, {.unknowns = 3000.0, .limit_s = 0.1}, yes);
  REQUIRE(gridded);
  CHECK(gridded->by == "ressort, on a grid");
  CHECK(gridded->failures.find("gmsh was stopped after 0.1 s\ntetgen was stopped after 0.1 s\n") ==
        0);
  int looks = 0;
  const auto called_off = with_path(folders, {.mesher = Mesher::tetgen},
                                    [&](std::string_view) { return ++looks < 10; });
  REQUIRE_FALSE(called_off);
  CHECK(called_off.error().message == stopped);

  workshop.put("tetgen", "#!/bin/sh\necho 'my disk is on fire' >&2\nexit 3\n");
  const auto failed = with_path(folders, {.mesher = Mesher::tetgen}, yes);
  REQUIRE_FALSE(failed);
  CHECK(failed.error().message.find("tetgen failed (exit code 3)") != std::string::npos);
  CHECK(failed.error().message.find("my disk is on fire") != std::string::npos);
}

TEST_CASE("Places and clamps are parsed", "[solid_body]") {
  const auto place = parse_place("rim=0.15,0,-1e-3");
  REQUIRE(place);
  CHECK(place->name == "rim");
  CHECK(place->point == Point3{0.15, 0.0, -1e-3});
  CHECK_FALSE(place->direction);
  const auto directed = parse_place("top=0,0,1,0,0,-1");
  REQUIRE(directed);
  REQUIRE(directed->direction);
  CHECK(*directed->direction == Point3{0.0, 0.0, -1.0});
  for (const char* wrong : {"", "rim", "rim=", "rim=1,2", "rim=1,2,x", "=1,2,3", "1=1,2,3",
                            "a b=1,2,3", "rim=1,2,3,4"}) {
    CHECK_FALSE(parse_place(wrong));
  }
  REQUIRE(parse_clamp("1,2,3,0.5"));
  for (const char* wrong : {"", "1,2,3", "1,2,3,-1", "1,2,3,x"}) {
    CHECK_FALSE(parse_clamp(wrong));
  }
}

TEST_CASE("The figure shows every triangle of the surface in each mode", "[solid_body]") {
  const auto mesh = quadratic(box_mesh({1.0, 1.0, 1.0}, {2, 2, 2}));
  REQUIRE(mesh);
  const auto modes = find_solid_modes(*mesh, {"", 1.0, 0.3, 1.0}, {}, 5, Progress());
  REQUIRE(modes);
  const plot::Figure figure = shapes_figure(*mesh, *modes, {{"a<b", 0, {0, 0, 1}}}, "a & b");
  REQUIRE(figure.panels.size() == 5);
  const auto svg = plot::draw(figure);
  REQUIRE(svg);
  // Six sides of eight triangles in each mode, hidden ones included.
  std::size_t polygons = 0;
  for (std::size_t at = svg->find("<polygon"); at != std::string::npos;
       at = svg->find("<polygon", at + 1)) {
    ++polygons;
  }
  CHECK(polygons == 5 * 48);
  CHECK(svg->find("a &amp; b") != std::string::npos);
  CHECK(svg->find("a&lt;b") != std::string::npos);
  CHECK(plot::to_script(figure).find("NaN") == std::string::npos);
}

}  // namespace
}  // namespace ressort::solid_body_test
