// The grid kernel: detection of regular structures, and equality with the direct kernel.
#include <functional>
#include <string>
#include <vector>

#include "core/kernels/grid/grid_form.h"
#include "tests/support/comparison.h"

namespace ressort::grid_test {
namespace {

using support::Comparison;
using support::ComparisonOptions;
using support::program_of;
using support::Random;
using support::same_as_direct;
using support::show;

Program formed(const std::string& text) {
  Program program = program_of(text);
  const std::optional<Grid> grid = grid_form(program);
  REQUIRE(grid);
  program.form = *grid;
  return program;
}

const Grid& grid_of(const Program& program) {
  return program.form.get<Grid>();
}

// Returns the text's lines and declarations in another order, with the ends of some links
// exchanged.
std::string shuffled(const std::string& text, std::uint64_t seed) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  Random random(seed);
  for (std::size_t i = lines.size(); i > 1; --i) {
    std::swap(lines[i - 1], lines[random.below(i)]);
  }
  std::string masses;
  std::string others;
  for (const std::string& line : lines) {
    const bool is_first =
        line.find(" mass ") != std::string::npos || line.find(" ground ") != std::string::npos ||
        line.find(" param ") != std::string::npos || line.find(" posInput ") != std::string::npos;
    (is_first ? masses : others) += line + "\n";
  }
  return masses + others;
}

// Returns the text with every springDamper replaced by another law with these arguments.
std::string with_law(const std::string& text, const std::string& keyword,
                     const std::string& arguments) {
  std::string changed;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    if (const std::size_t law = line.find("springDamper "); law != std::string::npos) {
      std::size_t after = law + 13;
      after = line.find(' ', line.find(' ', after) + 1);
      line =
          line.substr(0, law) + keyword + line.substr(law + 12, after - law - 12) + " " + arguments;
    }
    changed += line + "\n";
    at = end + 1;
  }
  return changed;
}

}  // namespace

TEST_CASE("A square mesh is one segment with four neighbours", "[grid]") {
  const Program program = formed(scenes::mesh_20x30());
  const Grid& grid = grid_of(program);
  REQUIRE(grid.segments.size() == 1);
  CHECK(grid.segments[0].offsets == std::vector<std::int32_t>{-32, -1, 1, 32});
  CHECK(grid.rest_ends.empty());
  CHECK(grid.loose.empty());
  std::size_t masses = 0;
  std::size_t ends = 0;  // number of link ends at masses
  for (std::size_t i = 0; i < grid.count; ++i) {
    masses += grid.moves[i];
    ends += grid.moves[i] * static_cast<std::size_t>(4 - grid.missing[i]);
  }
  CHECK(masses == 598);
  CHECK(ends == 2 * 1150 - 4);  // both grounds are corners
}

TEST_CASE("Instruments become grids and match the direct kernel", "[grid]") {
  const auto options = [](double reach, std::size_t frames) {
    return ComparisonOptions{.frames = frames, .reach = reach, .turns = true, .pitch = 0.8};
  };
  SECTION("20x30mesh") {
    same_as_direct(formed(scenes::mesh_20x30()), options(0.1, 44100), 1e-12, 100.0);
  }
  SECTION("LargeTriangleMesh") {
    // A pluck sticks and slips, so the motion is chaotic and can be compared only for a short time.
    const Program program = formed(scenes::large_triangle_mesh());
    CHECK(grid_of(program).rest_ends.size() < 12);
    same_as_direct(program, options(0.06, 4410), 1e-12, 90.0);
  }
  SECTION("1000massString") {
    same_as_direct(formed(scenes::string_1000()), options(0.1, 4410), 1e-12, 90.0);
  }
  SECTION("Resonator") {
    same_as_direct(formed(scenes::resonator()), options(1.0, 44100), 1e-11, 100.0);
  }
}

TEST_CASE("A mass of a triangle mesh has six neighbours, and a large mesh has one segment per row",
          "[grid]") {
  const std::string hands = "@in1 frcInput @t_m5_6\n@out1 posOutput @t_m7_7\n";
  const Program program = formed(scenes::triangle_mesh("t", 60, "0.1", "0.001") + hands);
  const Grid& grid = grid_of(program);
  CHECK(grid.segments.size() > 50);
  std::size_t longest = 0;
  for (const GridSegment& segment : grid.segments) {
    longest = std::max(longest, segment.offsets.size());
  }
  CHECK(longest == 6);
  CHECK(grid.count < 60 * 61);  // rows of equal length would need this many
  same_as_direct(program, {.frames = 4410}, 1e-12, 100.0);
}

TEST_CASE("The order of the text does not matter", "[grid]") {
  const std::vector<std::string> texts = {
      scenes::mesh_20x30(),
      scenes::triangle_mesh("t", 20, "0.1", "0.001") +
          "@in1 frcInput @t_m5_6\n@out1 posOutput @t_m7_7\n",
      scenes::string("s", 200, "0.1", "0.001") + "@in1 frcInput @s_m5\n@out1 posOutput @s_m70\n"};
  for (const std::string& text : texts) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Program program = formed(shuffled(text, seed));
      INFO("seed " << seed);
      CHECK(grid_of(program).rest_ends.size() <= 2);
      CHECK(!grid_of(program).segments.empty());
      same_as_direct(program, {.frames = 4410}, 1e-12, 100.0);
    }
  }
}

TEST_CASE("Every link of a grid may have any law", "[grid]") {
  const std::string mesh = scenes::square_mesh("m", 12, 15, "0.1", "0.01") +
                           "@in1 frcInput @m_m5_6\n@out1 posOutput @m_m7_7\n";
  struct Row {
    std::string keyword;
    std::string arguments;
  };
  const Row row = GENERATE(values<Row>({{"nlSpring3", "m_K 0.05 m_Z"},
                                        {"nlSpring2", "m_K 0.05 m_Z"},
                                        {"nlSpringDamper", "0.05 0.02 m_K m_Z"},
                                        {"contact", "m_K m_Z 0.5"}}));
  INFO(row.keyword);
  const std::string text = with_law(mesh, row.keyword, row.arguments);
  for (const std::string& written : {text, shuffled(text, 7)}) {
    const Program program = formed(written);
    CHECK(grid_of(program).segments.empty());
    same_as_direct(program, {.frames = 8820, .turns = true, .pitch = 1.1}, 1e-11, 80.0);
  }
}

TEST_CASE("Macros become grids with points on them", "[grid]") {
  const std::string ends = "@u param 0.3\n@in1 frcInput [@s u 0.5]\n@out1 posOutput [@s 0.75 u]\n";
  const std::string line_ends = "@u param 0.3\n@in1 frcInput [@s u]\n@out1 posOutput [@s 0.75]\n";
  const std::string text = GENERATE_COPY(
      "@s mesh 20 20 1. 0.1 0.001 0.\n" + ends, "@s closedMesh 20 20 1. 0.1 0.001 0.\n" + ends,
      "@s cornerMesh 20 20 1. 0.1 0.001 0.\n" + ends, "@s string 100 1. 0.1 0.001 0.\n" + line_ends,
      "@s chain 100 1. 0.1 0.001 0.\n" + line_ends,
      "@s stiffString 100 1. 0.2 0.1 0.001 0.\n" + line_ends);
  INFO(text);
  same_as_direct(formed(text), {.frames = 8820, .turns = true}, 1e-11, 90.0);
}

TEST_CASE("Grounds away from 0 are copied to the slots that need them", "[grid]") {
  const std::string mesh = scenes::square_mesh("m", 12, 15, "0.1", "0.01");
  std::string text;
  for (std::size_t at = 0; at < mesh.size();) {
    const std::size_t end = mesh.find('\n', at);
    std::string line = mesh.substr(at, end - at);
    if (const std::size_t ground = line.find("ground 0."); ground != std::string::npos) {
      line = line.substr(0, ground) + "ground 0.4";
    }
    text += line + "\n";
    at = end + 1;
  }
  text += "@in1 frcInput @m_m5_6\n@out1 posOutput @m_m7_7\n@out2 posOutput @m_m0_0\n";
  const Program linear = formed(text);
  CHECK(grid_of(linear).rest_ends.empty());
  same_as_direct(linear, {.frames = 8820, .turns = true}, 1e-12, 90.0);
  const Program cubic = formed(with_law(text, "nlSpring3", "m_K 0.05 m_Z"));
  CHECK(grid_of(cubic).rest_ends.empty());
  same_as_direct(cubic, {.frames = 8820, .turns = true}, 1e-11, 80.0);
}

TEST_CASE("Networks with a few irregularities become grids", "[grid]") {
  // Masses that oscillate and fall, some links left out, some additional links between random
  // masses, and a hammer.
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed);
    const auto rows = static_cast<int>(6 + random.below(15));
    const auto columns = static_cast<int>(6 + random.below(30));
    const bool is_cubic = random.below(2) == 0;
    const std::string mesh = scenes::square_mesh("m", rows, columns, "0.1", "0.01");
    std::string text;
    for (std::size_t at = 0; at < mesh.size();) {
      const std::size_t end = mesh.find('\n', at);
      if (mesh.find("springDamper", at) > end || random.below(100) > 0) {
        text += mesh.substr(at, end - at) + "\n";
      }
      at = end + 1;
    }
    const auto some = [&] {
      return "@m_m" + std::to_string(1 + random.below(static_cast<std::size_t>(rows) - 2)) + "_" +
             std::to_string(random.below(static_cast<std::size_t>(columns)));
    };
    text = is_cubic ? with_law(text, "nlSpring3", "m_K 0.05 m_Z") : text;
    text += "@g0 ground 0.1\n@h mass 3. 0.05 0.05\n@h_r springDamper @h " + some() + " 0.02 0.01\n";
    text += "@x1 springDamper " + some() + " @g0 m_K m_Z\n@x2 spring " + some() + " @h 0.05\n";
    text += "@c contact " + some() + " @g0 0.1 0.01 0.3\n";
    text += "@in1 frcInput " + some() + "\n@in2 frcInput @h\n";
    text += "@out1 posOutput " + some() + "\n@out2 posOutput @h\n";
    INFO("seed " << seed << ": " << rows << " x " << columns);
    const Program program = formed(text);
    same_as_direct(program, {.frames = 4410, .seed = seed, .turns = true}, 1e-11, 80.0);
  }
}

TEST_CASE("Strings of several kinds in one grid match the direct kernel", "[grid]") {
  for (const int longer : {10, 70, 100, 300}) {
    for (const int shorter : {9, 16, 40}) {
      INFO(longer << " and " << shorter << " masses");
      std::string text = "@s_K param 0.1\n@t_K param 0.05\n@g ground 0.\n";
      for (const auto& [prefix, count] :
           {std::pair<std::string, int>("s", longer), std::pair<std::string, int>("t", shorter)}) {
        for (int i = 0; i < count; ++i) {
          text += scenes::at(prefix + "_m", i) + " mass 1. 0. 0.\n" + scenes::at(prefix + "_r", i) +
                  " springDamper " + (i == 0 ? "@g" : scenes::at(prefix + "_m", i - 1)) + " " +
                  scenes::at(prefix + "_m", i) + " " + prefix + "_K 0.01\n";
        }
      }
      text += "@in1 frcInput @s_m3\n@in2 frcInput @t_m3\n" + scenes::output(1, "s_m1") +
              scenes::output(2, "t_m1");
      Program program = program_of(text);
      if (const std::optional<Grid> grid = grid_form(program)) {
        program.form = *grid;
        same_as_direct(program, {.frames = 1000}, 1e-12, 100.0);
      }
    }
  }
}

TEST_CASE("The link that closes a ring is computed separately", "[grid]") {
  // Each mass would add two empty slots to its sum, and float would lose precision in its position.
  std::string text = "@k param 0.01\n@g ground 0.\n";
  for (int i = 0; i < 29; ++i) {
    text += scenes::at("m", i) + " mass 1. 0. 0.\n" + scenes::at("r", i) + " springDamper " +
            scenes::at("m", i) + " " + scenes::at("m", (i + 1) % 29) + " k 0.01\n";
  }
  const Program program =
      formed(text + "@h springDamper @m3 @g 0.1 0.01\n@in1 frcInput @m8\n@out1 posOutput @m20\n");
  CHECK(grid_of(program).segments.at(0).offsets == std::vector<std::int32_t>{-1, 1});
  CHECK(grid_of(program).rest_ends.size() == 2);
  same_as_direct(program, {.frames = 20000}, 1e-12, 115.0);
}

TEST_CASE("A reset grid repeats its motion", "[grid]") {
  for (const std::string keyword : {"springDamper", "nlSpring3"}) {
    const Program program =
        formed(with_law(scenes::mesh_20x30(), keyword,
                        keyword == "nlSpring3" ? "mesh_K 0.05 mesh_Z" : "mesh_K mesh_Z"));
    support::Bare<double> bare(program);
    std::vector<std::vector<double>> first;
    for (int n = 0; n < 101; ++n) {
      first.push_back(bare.step({n == 0 ? 1.0 : 0.0}));
    }
    CHECK(!bare.kernel().is_near_start(0, 1e-3));
    bare.kernel().reset(0);
    CHECK(bare.kernel().is_near_start(0, 1e-12));
    for (int n = 0; n < 101; ++n) {
      REQUIRE(bare.step({n == 0 ? 1.0 : 0.0}) == first[static_cast<std::size_t>(n)]);
    }
  }
}

TEST_CASE("Irregular networks have no grid form", "[grid]") {
  std::string star = "@hub mass 1. 0. 0.\n";
  std::string pairs;
  for (int i = 0; i < 100; ++i) {
    star += scenes::at("m", i) + " mass 1. 0. 0.\n" + scenes::at("r", i) + " springDamper @hub " +
            scenes::at("m", i) + " 0.001 0.001\n";
  }
  Random random(3);
  std::string web;
  for (int i = 0; i < 100; ++i) {
    web += scenes::at("m", i) + " mass 1. 0. 0.\n";
  }
  for (int i = 0; i < 300; ++i) {
    const auto any = [&] { return scenes::at("m", static_cast<int>(random.below(100))); };
    web += scenes::at("r", i) + " springDamper " + any() + " " + any() + " 0.01 0.001\n";
  }
  CHECK(!grid_form(program_of(star)));
  CHECK(!grid_form(program_of(web)));
  CHECK(!grid_form(program_of(scenes::poly_triangle())));
  CHECK(!grid_form(program_of(scenes::mesh_20x30() + "@out3 frcOutput @mesh_m2_6\n")));
}

}  // namespace ressort::grid_test
