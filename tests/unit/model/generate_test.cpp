// Regular shapes: numbers of points and links, equality with macros, and
// errors.
#include "core/model/generate.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::generate_test {
namespace {

Network made(const Shape& shape) {
  auto network = generate(shape);
  INFO((network ? std::string() : network.error().message));
  REQUIRE(network);
  return *std::move(network);
}

std::size_t count(const Network& network, MassKind kind) {
  return static_cast<std::size_t>(
      std::count_if(network.masses.begin(), network.masses.end(),
                    [&](const Mass& mass) { return mass.kind == kind; }));
}

// Returns the number of masses that links connect with one mass.
std::size_t reach(const Network& network) {
  std::vector<std::vector<std::uint32_t>> near(network.masses.size());
  for (const Link& link : network.links) {
    near[link.a].push_back(link.b);
    near[link.b].push_back(link.a);
  }
  std::vector<bool> seen(network.masses.size(), false);
  std::vector<std::uint32_t> next = {0};
  std::size_t reached = 0;
  while (!next.empty()) {
    const std::uint32_t mass = next.back();
    next.pop_back();
    if (!seen[mass]) {
      seen[mass] = true;
      ++reached;
      next.insert(next.end(), near[mass].begin(), near[mass].end());
    }
  }
  return reached;
}

// Returns the output after a unit impulse, by the reference scheme.
std::vector<double> by_the_book(const Network& network, std::size_t frames) {
  auto simulation = reference::make_simulation(network, parameter_values(network));
  std::vector<double> heard;
  for (std::size_t n = 0; n < frames; ++n) {
    heard.push_back(simulation.simulator.step(std::vector{n == 0 ? 1.0 : 0.0})[0]);
  }
  return heard;
}

constexpr ShapeKind all_kinds[] = {
    ShapeKind::string,      ShapeKind::stiff_string, ShapeKind::chain,    ShapeKind::mesh,
    ShapeKind::closed_mesh, ShapeKind::corner_mesh,  ShapeKind::triangle, ShapeKind::hexagon};

bool is_plane(ShapeKind kind) {
  return kind == ShapeKind::mesh || kind == ShapeKind::closed_mesh ||
         kind == ShapeKind::corner_mesh;
}

}  // namespace

TEST_CASE("shapes have the documented numbers of points and links", "[generate]") {
  for (std::uint32_t n = 3; n <= 12; ++n) {
    const std::uint32_t w = n + 2;
    struct Count {
      ShapeKind kind;
      FixedPoints fixed;
      std::uint32_t points;
      std::uint32_t held;
      std::uint32_t links;
    };
    const std::uint32_t grid = n * (w - 1) + w * (n - 1);
    const std::uint32_t triangle = n * (n + 1) / 2;
    const std::uint32_t hexagon = 1 + 3 * n * (n + 1);
    for (const Count& expected : {
             Count{ShapeKind::string, {}, n, 2, n - 1},
             Count{ShapeKind::stiff_string, {}, n, 2, 2 * n - 1},
             Count{ShapeKind::chain, {}, n, 0, n - 1},
             Count{ShapeKind::mesh, {}, n * w, 0, grid},
             Count{ShapeKind::closed_mesh, {}, n * w, 2 * (n + w) - 4, grid},
             Count{ShapeKind::corner_mesh, {}, n * w, 4, grid},
             Count{ShapeKind::triangle, FixedPoints::none, triangle, 0, 3 * n * (n - 1) / 2},
             Count{ShapeKind::triangle, FixedPoints::corners, triangle, 3, 3 * n * (n - 1) / 2},
             Count{ShapeKind::triangle, FixedPoints::border, triangle, 3 * (n - 1),
                   3 * n * (n - 1) / 2},
             Count{ShapeKind::hexagon, FixedPoints::none, hexagon, 0, 9 * n * n + 3 * n},
             Count{ShapeKind::hexagon, FixedPoints::corners, hexagon, 6, 9 * n * n + 3 * n},
             Count{ShapeKind::hexagon, FixedPoints::border, hexagon, 6 * n, 9 * n * n + 3 * n},
         }) {
      if (expected.points == expected.held) {
        continue;  // all points of the smallest triangle are on its border
      }
      const Network network = made({.kind = expected.kind,
                                    .length = n,
                                    .width = is_plane(expected.kind) ? w : 0,
                                    .fixed = expected.fixed,
                                    .with_io = false});
      CAPTURE(static_cast<int>(expected.kind), static_cast<int>(expected.fixed), n);
      CHECK(network.masses.size() == expected.points);
      CHECK(count(network, MassKind::ground) == expected.held);
      CHECK(network.links.size() == expected.links);
      CHECK(reach(network) == expected.points);
    }
  }
}

TEST_CASE("inner points of a triangle have six neighbours at equal distances", "[generate]") {
  for (const ShapeKind kind : {ShapeKind::triangle, ShapeKind::hexagon}) {
    const Network network =
        made({.kind = kind, .length = 7, .fixed = FixedPoints::border, .with_io = false});
    std::vector<int> neighbours(network.masses.size(), 0);
    for (const Link& link : network.links) {
      ++neighbours[link.a];
      ++neighbours[link.b];
      REQUIRE(link.a != link.b);
      const auto place = [&](std::uint32_t mass) {
        return network.drawings[network.masses[mass].drawing - 1];
      };
      const double x = std::fabs(place(link.a).x - place(link.b).x);
      const double y = std::fabs(place(link.a).y - place(link.b).y);
      // The distance is 0.1 along a row; rows are 0.1 apart and shifted by half a step.
      CHECK(((std::fabs(x) < 1e-12 && std::fabs(y - 0.1) < 1e-12) ||
             (std::fabs(x - 0.1) < 1e-12 && std::fabs(y - 0.05) < 1e-12)));
    }
    for (std::size_t i = 0; i < neighbours.size(); ++i) {
      if (network.masses[i].kind == MassKind::mass) {
        CHECK(neighbours[i] == 6);
      }
    }
  }
}

TEST_CASE("a generated shape equals the expanded macro", "[generate]") {
  for (const ShapeKind kind : all_kinds) {
    if (kind == ShapeKind::triangle || kind == ShapeKind::hexagon) {
      continue;
    }
    for (const double air : {0.0, 0.0005}) {
      CAPTURE(static_cast<int>(kind), air);
      // The macro's input and output are at nodes if there are 11 points.
      Shape shape{.kind = kind,
                  .length = 11,
                  .width = is_plane(kind) ? 11u : 0u,
                  .mass = 1.5,
                  .stiffness = 0.2,
                  .second_stiffness = 0.07,
                  .damping = 0.003,
                  .air_damping = air};
      const Network written = made(shape);
      shape.as_macro = true;
      const Network macro = made(shape);
      CHECK(macro.macros.size() == 1);
      support::Bare<double> engine(make_program(macro, 44100.0, true));
      const std::vector<double> expected = by_the_book(written, 500);
      support::Comparison comparison;
      for (std::size_t n = 0; n < 500; ++n) {
        comparison.add(expected[n], engine.step(std::vector{n == 0 ? 1.0 : 0.0})[0]);
      }
      CHECK(comparison.peak > 0.01);
      CHECK(comparison.worst <= 1e-12);

      // Compares points and links one by one.
      shape.with_io = false;
      const Network expanded = expand_macros(made(shape));
      shape.as_macro = false;
      const Network bare = made(shape);
      REQUIRE(bare.masses.size() == expanded.masses.size());
      for (std::size_t i = 0; i < bare.masses.size(); ++i) {
        CHECK(bare.masses[i].kind == expanded.masses[i].kind);
      }
      const auto links = [](const Network& network) {
        const std::vector<double> values = parameter_values(network);
        std::vector<std::array<double, 4>> found;
        for (const Link& link : network.links) {
          found.push_back({static_cast<double>(link.a), static_cast<double>(link.b),
                           argument_value(network, link.arguments[0], values),
                           argument_value(network, link.arguments[1], values)});
        }
        std::sort(found.begin(), found.end());
        return found;
      };
      CHECK(links(bare) == links(expanded));
    }
  }
}

TEST_CASE("a generated shape is audible, stable and free of warnings", "[generate]") {
  for (const ShapeKind kind : all_kinds) {
    for (const bool as_macro : {false, true}) {
      if (as_macro && (kind == ShapeKind::triangle || kind == ShapeKind::hexagon)) {
        continue;
      }
      for (const FixedPoints fixed : {FixedPoints::none, FixedPoints::corners}) {
        CAPTURE(static_cast<int>(kind), as_macro, static_cast<int>(fixed));
        const Network network = made({.kind = kind,
                                      .length = 9,
                                      .width = is_plane(kind) ? 7u : 0u,
                                      .fixed = fixed,
                                      .position = 0.25,
                                      .as_macro = as_macro});
        const ParsedNetwork read = parse_network(print_network(network));
        CHECK(read.diagnostics.empty());
        CHECK(read.network == network);
        CHECK(network.inputs.size() == 1);
        CHECK(network.outputs.size() == 1);
        CHECK((as_macro || network.inputs[0].mass != network.outputs[0].mass));
        auto compiled = compile_network(network, default_preset(network, true),
                                        {.bare = true, .method = Method::direct});
        REQUIRE(compiled);
        CHECK(compiled->instrument.stiffness_margin >= 1.0);
        // The shape rests at 0.25 until a push, then oscillates around it for at least a second.
        std::vector<double> push(44100, 0.0);
        push[100] = 0.1;
        std::vector<double> heard(push.size());
        double* const outputs[] = {heard.data()};
        const double* const inputs[] = {push.data()};
        compiled->engine->process({}, inputs, outputs, heard.size());
        double peak = 0.0;
        for (std::size_t n = 0; n < heard.size(); ++n) {
          REQUIRE(std::fabs(heard[n] - 0.25) < (n < 100 ? 1e-15 : 1.0));
          peak = std::max(peak, std::fabs(heard[n] - 0.25));
        }
        CHECK(peak > 1e-3);
      }
    }
  }
}

TEST_CASE("labels and numbers follow the options", "[generate]") {
  CHECK(print_network(made({.kind = ShapeKind::stiff_string,
                            .length = 4,
                            .name = "low",
                            .mass = 2.0,
                            .stiffness = 0.5,
                            .second_stiffness = 0.25,
                            .damping = 0.01,
                            .air_damping = 0.003})) ==
        "# Parameters\n@low_M param 2\n@low_K param 0.5\n@low_Z param 0.01\n@low_K2 param 0.25\n"
        "@low_Zo param 0.003\n\n"
        "# Masses\n@low_s0 ground 0\n@low_m0 osc low_M 0 low_Zo 0 0\n"
        "@low_m1 osc low_M 0 low_Zo 0 0\n@low_s1 ground 0\n\n"
        "# Links\n@low_r0 springDamper @low_s0 @low_m0 low_K low_Z\n"
        "@low_r1 springDamper @low_m0 @low_m1 low_K low_Z\n"
        "@low_r2 springDamper @low_m1 @low_s1 low_K low_Z\n"
        "@low_rs0 spring @low_s0 @low_m1 low_K2\n@low_rs1 spring @low_m0 @low_s1 low_K2\n"
        "@low_rs2 spring @low_s0 @low_m0 low_K2\n@low_rs3 spring @low_m1 @low_s1 low_K2\n\n"
        "# Inputs\n@in1 frcInput @low_m0\n\n# Outputs\n@out1 posOutput @low_m1\n");
  CHECK(print_network(made({.kind = ShapeKind::corner_mesh,
                            .length = 20,
                            .width = 30,
                            .name = "m",
                            .as_macro = true})) ==
        "# Parameters\n@m_M param 1\n@m_K param 0.1\n@m_Z param 0.001\n\n"
        "# Macros\n@m cornerMesh 20 30 m_M m_K m_Z 0 0\n\n"
        "# Inputs\n@in1 frcInput [@m 0.3 0.4]\n\n# Outputs\n@out1 posOutput [@m 0.8 0.7]\n");
}

TEST_CASE("invalid shapes are rejected with a reason", "[generate]") {
  struct Wrong {
    Shape shape;
    const char* message;
  };
  for (const Wrong& wrong : {
           Wrong{{.length = 2}, "this shape needs a size of at least 3"},
           Wrong{{.length = 5, .width = 5}, "this shape has one size, not two"},
           Wrong{{.kind = ShapeKind::mesh, .length = 5},
                 "this shape needs a size of at least 2 by 2"},
           Wrong{{.kind = ShapeKind::corner_mesh, .length = 2, .width = 2},
                 "this shape has only corners, which are fixed"},
           Wrong{{.kind = ShapeKind::triangle, .length = 2},
                 "all points of this shape are fixed: choose a larger size"},
           Wrong{{.kind = ShapeKind::hexagon}, "this shape needs a size of at least 1"},
           Wrong{{.length = 100'001},
                 "this shape may have at most 100000 points, or 4000000 as a macro"},
           Wrong{{.kind = ShapeKind::hexagon, .length = 0xffffffffu},
                 "this shape may have at most 100000 points"},
           Wrong{{.kind = ShapeKind::closed_mesh, .length = 2001, .width = 2000, .as_macro = true},
                 "this shape may have at most 4000000 points"},
           Wrong{{.kind = ShapeKind::hexagon, .length = 3, .as_macro = true},
                 "there is no macro for triangles and hexagons"},
           Wrong{{.length = 5, .name = "in1", .as_macro = true},
                 "the name 'in1' is reserved for a channel"},
           Wrong{{.length = 5, .name = "a b"},
                 "a name has at most 32 letters, digits and '_', and does not start with a digit"},
           Wrong{{.length = 5, .mass = 0.0}, "a mass must be above 0"},
           Wrong{{.length = 5, .mass = std::nan("")}, "a mass must be above 0"},
           Wrong{{.length = 5, .stiffness = -1.0}, "a stiffness or damping must not be below 0"},
           Wrong{{.length = 5, .damping = HUGE_VAL}, "a stiffness or damping must not be below 0"},
           Wrong{{.length = 5, .position = HUGE_VAL}, "a position must be a number"},
       }) {
    INFO(wrong.message);
    const auto network = generate(wrong.shape);
    REQUIRE_FALSE(network);
    CHECK(network.error().message == wrong.message);
  }
  CHECK(generate({.length = 100'000}));
  CHECK(generate({.kind = ShapeKind::mesh, .length = 2000, .width = 2000, .as_macro = true}));
}

}  // namespace ressort::generate_test
