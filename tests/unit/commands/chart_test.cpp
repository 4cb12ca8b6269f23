// The chart: Pareto fronts by hand, and the two references against closed forms and the textbook
// simulator.
#include "app/commands/chart/chart.h"

#include <cmath>
#include <numbers>

#include "app/commands/chart/judge.h"
#include "app/commands/chart/reference_scheme.h"
#include "core/analysis/continuous.h"
#include "core/model/language/mdl.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::chart_test {
namespace {

ChartScene scene_called(const std::string& name) {
  auto scene = chart_scene(name);
  REQUIRE(scene);
  return *std::move(scene);
}

// Returns the poles at the first output, from the lowest.
std::vector<std::complex<double>> poles_of(const ChartScene& scene) {
  const auto outputs = solve_continuous(scene.network, parameter_values(scene.network));
  REQUIRE(outputs);
  std::vector<std::complex<double>> poles;
  for (const ContinuousOutput::Term& term : outputs->at(0).terms) {
    poles.push_back(term.pole);
  }
  std::ranges::sort(poles, {}, [](const auto& pole) { return pole.imag(); });
  return poles;
}

MadeWay made(const ChartScene& scene, const Way& way) {
  auto result = make_way(scene, way, heard_s, Isa::base);
  REQUIRE(result);
  return *std::move(result);
}

const Way direct{.name = "direct", .method = Method::direct};

}  // namespace

TEST_CASE("Only points that no other point beats are on the Pareto front", "[chart]") {
  const double nan = std::nan("");
  const std::vector<CostAndAccuracy> points = {{10.0, 40.0},   {100.0, 60.0}, {100.0, 50.0},
                                               {50.0, 40.0},   {5.0, nan},    {10.0, 40.0},
                                               {1000.0, 61.0}, {1.0, -3.0}};
  CHECK(front_of(points) == std::vector<bool>{true, true, false, false, false, false, true, true});
}

TEST_CASE("Partials of the continuous string follow the closed form", "[chart]") {
  const auto poles = poles_of(scene_called("string50"));
  REQUIRE(poles.size() == 50);
  for (std::size_t j = 1; j <= 50; ++j) {
    const double lambda =
        4.0 * std::pow(std::sin(static_cast<double>(j) * std::numbers::pi / 102.0), 2);
    const double sigma = 0.0005 * lambda;
    const double omega = std::sqrt(0.1 * lambda - sigma * sigma);
    CHECK(poles[j - 1].imag() == Approx(omega).epsilon(1e-12));
    CHECK(poles[j - 1].real() == Approx(-sigma).epsilon(1e-11));
  }
  CHECK(poles[0].imag() * 44100.0 / (2.0 * std::numbers::pi) ==
        Approx(136.700388536816).epsilon(1e-12));
}

TEST_CASE("The continuous triangle has the published partials", "[chart]") {
  const auto poles = poles_of(scene_called("triangle"));
  REQUIRE(poles.size() == 3);
  const double hz[] = {857.3469979368184, 3844.30396770083, 4062.585604505056};
  const double t60[] = {0.11716233357043, 0.10442562780018, 0.030338267322174};
  for (std::size_t j = 0; j < 3; ++j) {
    CHECK(poles[j].imag() * 44100.0 / (2.0 * std::numbers::pi) == Approx(hz[j]).epsilon(1e-11));
    CHECK(3.0 * std::numbers::ln10 / -poles[j].real() / 44100.0 == Approx(t60[j]).epsilon(1e-10));
  }
}

TEST_CASE("The reference scheme steps like the textbook simulator", "[chart]") {
  for (const scenes::Example& example : scenes::nine_instruments()) {
    if (example.moving > 400) {
      continue;
    }
    CAPTURE(example.name);
    const Network network = support::network_of(example.text);
    const Program program = make_program(network, Network::reference_rate_hz, true);
    ReferenceScheme book(program);
    auto reference = reference::make_simulation(network, parameter_values(network));
    const support::Motion motion(7, 20.0, 400.0);
    std::vector<double> value(program.inputs.size());
    std::vector<double> velocity(value.size());
    for (std::size_t i = 0; i < value.size(); ++i) {
      value[i] = program.inputs[i].is_force ? 0.0 : program.position[program.inputs[i].node];
    }
    double peak = 0.0;
    double worst = 0.0;
    for (std::size_t n = 0; n < 3000; ++n) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        const double next = program.position[program.inputs[i].node] + example.reach * motion(n);
        velocity[i] = next - value[i];
        value[i] = next;
      }
      book.step(value, velocity);
      const std::vector<double> expected = reference.simulator.step(value);
      const std::vector<double> found = book.outputs();
      for (std::size_t o = 0; o < found.size(); ++o) {
        const double right = expected[program.outputs[o].channel];
        peak = std::max(peak, std::fabs(right));
        worst = std::max(worst, std::fabs(found[o] - right));
      }
    }
    CHECK(peak > 0.0);
    // Velocities of inputs are rounded to double here only, which bows and plucks amplify.
    CHECK(worst <= (example.is_linear ? 1e-12 : 1e-9) * peak);
  }
}

TEST_CASE("Errors against the continuous network are those of the theory", "[chart]") {
  const auto seconds = static_cast<std::size_t>(heard_s * 44100.0);
  struct Known {
    const char* scene;
    double published_db;  // within half a dB
  };
  for (const Known& known : {Known{"string50", 19.8}, {"string150", 13.5}, {"20x30mesh", 21.4}}) {
    CAPTURE(known.scene);
    const ChartScene scene = scene_called(known.scene);
    const Starts starts(scene);
    const auto references = find_references(scene, starts.at(1), Isa::base);
    REQUIRE(references);
    const auto physical_db = [&](const Way& way) {
      MadeWay one = made(starts.at(way.oversampling), way);
      return signal_to_error_db(references->physical, render_way(one, seconds), 0, seconds);
    };
    MadeWay way = made(starts.at(1), direct);
    CHECK(signal_to_error_db(references->published, render_way(way, seconds), 0, seconds) >= 200.0);
    CHECK(physical_db(direct) == Approx(known.published_db).margin(0.5));
    // Second order: 12 dB less at each doubling of the rate, once all partials are resolved.
    CHECK(physical_db({.name = "4x", .method = Method::direct, .oversampling = 4}) >=
          known.published_db + 16.0);
    CHECK(physical_db({.name = "exact", .method = Method::modal, .budget = "cents=1"}) >= 200.0);
  }
}

TEST_CASE("A network at rest is struck, and the sheet says so", "[chart]") {
  // The masses are displaced from the origin but at rest: no link exerts a force.
  const ParsedNetwork parsed = parse_network(
      "@m mass 1. 1. 0.\n@n mass 1. 1. 0.\n@r springDamper @m @n 0.1 0.001\n@out1 posOutput @m\n");
  ChartScene scene{.name = "pair", .network = parsed.network, .is_linear = true};
  scene.about = "as it starts";
  scene.motions.resize(scene.network.inputs.size());
  const auto sheet = make_sheet(scene, Isa::base, 0.0, [](const std::string&) { return true; });
  REQUIRE(sheet);
  CHECK_FALSE(sheet->rows.empty());
  CHECK(sheet->about.find("an impulse at the first mass") != std::string::npos);
}

TEST_CASE("The energy test finds a hard contact that gains energy", "[chart]") {
  const ChartScene string = scene_called("string50");
  MadeWay way = made(string, direct);
  const auto lossy = watch_energy(way, 0.25);
  REQUIRE(lossy);
  CHECK(lossy->highest == Approx(lossy->first).epsilon(1e-9));
  const ChartScene ball = scene_called("ball");
  MadeWay bouncing = made(ball, direct);
  const auto gained = watch_energy(bouncing, 5.0);
  REQUIRE(gained);
  CHECK(gained->highest > 1.2 * gained->first);
  MadeWay fine = made(ball, {.name = "fine", .method = Method::direct, .oversampling = 64});
  const auto kept = watch_energy(fine, 5.0);
  REQUIRE(kept);
  CHECK(kept->highest < 1.01 * kept->first);
  CHECK_FALSE(Stress(ball, Isa::base).verdict(direct).empty());
  CHECK(Stress(string, Isa::base).verdict(direct).empty());
}

TEST_CASE("The table and the figures show every method", "[chart]") {
  ChartSheet sheet{.scene = "a scene", .about = "plucked", .reference = "exact modes"};
  sheet.rows.resize(3);
  const double ns[] = {100.0, 20.0, 10.0};
  const double snr_db[] = {250.0, 30.0, 40.0};
  for (std::size_t i = 0; i < 3; ++i) {
    sheet.rows[i] = {.way = {.name = "way " + std::to_string(i), .line = "way"},
                     .methods = "direct",
                     .ns = ns[i],
                     .snr_db = {snr_db[i], std::nan("")}};
  }
  sheet.rows[2].failure = "gains energy, quickly";
  find_fronts(sheet);
  const std::string csv = chart_csv({sheet}, "by hand");
  CHECK(csv.find("a scene,way 0,double,direct,1,,100,208.333,250,,1,0,,\n") != csv.npos);
  CHECK(csv.find("a scene,way 1,double,direct,1,,20,1041.67,30,,1,0,,\n") != csv.npos);
  CHECK(csv.find(",40,,0,0,\"gains energy, quickly\",\n") != csv.npos);
  const plot::Figure figure = sheet_figure(sheet, "by hand");
  REQUIRE(figure.panels.size() == 2);
  const std::string script = plot::to_script(figure);
  CHECK(script.find("\n100 -250\n20 -30\nEOD") != script.npos);
  CHECK(plot::to_script(overview_figure({sheet, sheet}, "by hand")).find("NaN with") !=
        script.npos);
}

}  // namespace ressort::chart_test
