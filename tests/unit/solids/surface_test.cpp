#include "core/solids/surface.h"

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/solids.h"

namespace ressort::surface_test {
namespace {

using namespace support;

Result<ClosedSurface> closed(const Surface& surface) {
  return close_surface(surface, Progress());
}

TEST_CASE("a solid is the same from ASCII, binary and OBJ", "[surface]") {
  const Surface ball = icosphere(2, 0.5, true);
  const auto ascii = read_surface(ascii_stl(ball));
  const auto binary = read_surface(binary_stl(ball));  // Its header begins with "solid".
  const auto faces = read_surface(obj(ball));
  REQUIRE(ascii);
  REQUIRE(binary);
  REQUIRE(faces);
  for (const auto& read : {*ascii, *binary, *faces}) {
    const auto solid = closed(read);
    REQUIRE(solid);
    CHECK(solid->surface.points.size() == 162);
    CHECK(solid->surface.triangles.size() == 320);
    CHECK(solid->shells == 1);
    CHECK(solid->repairs.turned == 0);
    // The sphere's volume, to float precision.
    CHECK(solid->volume == Approx(std::numbers::pi / 6.0).epsilon(1e-6));
  }
}

namespace {

// A cuboid of 200, 20 and 10 in each format.
constexpr double corners[8][3] = {{0, 0, 0},  {200, 0, 0},  {200, 20, 0},  {0, 20, 0},
                                  {0, 0, 10}, {200, 0, 10}, {200, 20, 10}, {0, 20, 10}};
constexpr int sides[6][4] = {{3, 2, 1, 0}, {4, 5, 6, 7}, {0, 1, 5, 4},
                             {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

template <class Number>
void append_raw(std::string& bytes, Number number, bool is_big) {
  char raw[sizeof(Number)];
  std::memcpy(raw, &number, sizeof raw);
  if (is_big) {
    std::reverse(std::begin(raw), std::end(raw));
  }
  bytes.append(raw, sizeof raw);
}

std::string ply(const std::string& format) {
  std::string text = "ply\nformat " + format +
                     " 1.0\ncomment made here\nelement vertex 8\nproperty float x\n"
                     "property float y\nproperty double z\nproperty uchar red\nelement face 6\n"
                     "property list uchar int vertex_indices\nelement edge 1\nproperty int one\n"
                     "end_header\n";
  const bool is_text = format == "ascii";
  const bool is_big = format == "binary_big_endian";
  for (const auto& p : corners) {
    if (is_text) {
      text +=
          std::to_string(p[0]) + " " + std::to_string(p[1]) + "\n" + std::to_string(p[2]) + " 9\n";
      continue;
    }
    append_raw(text, static_cast<float>(p[0]), is_big);
    append_raw(text, static_cast<float>(p[1]), is_big);
    append_raw(text, p[2], is_big);
    text += '\x09';
  }
  for (const auto& side : sides) {
    text += is_text ? "4" : "\x04";
    for (const int point : side) {
      if (is_text) {
        text += " " + std::to_string(point);
      } else {
        append_raw(text, point, is_big);
      }
    }
    text += is_text ? "\n" : "";
  }
  return text + (is_text ? "1\n" : std::string("\0\0\0\1", 4));
}

}  // namespace

TEST_CASE("a solid's format is that of its content", "[surface]") {
  std::string off = "OFF # a comment\n8 6 0\n";
  std::string continued = "# made here\n";
  for (const auto& p : corners) {
    const std::string numbers =
        std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
    off += numbers;
    continued += "v " + numbers;
  }
  for (const auto& side : sides) {
    off += "4";
    continued += "f";
    for (std::size_t i = 0; i < 4; ++i) {
      off += " " + std::to_string(side[i]);
      continued += " " + std::to_string(side[i] + 1) + (i == 1 ? " \\\r\n" : "");
    }
    off += " 255 0 0\n";
    continued += "\n";
  }
  const auto cuboid = read_surface(continued);
  REQUIRE(cuboid);
  const std::string ascii = ascii_stl(*cuboid);
  std::string parted = ascii;
  std::string commas = ascii;
  for (const auto& [from, to] :
       {std::pair("endloop", "end loop"), std::pair("endfacet", "end facet"),
        std::pair("endsolid", "end solid")}) {
    for (std::size_t at = parted.find(from); at != parted.npos; at = parted.find(from, at + 9)) {
      parted.replace(at, std::string_view(from).size(), to);
    }
  }
  std::replace(commas.begin(), commas.end(), '.', ',');
  const std::string tail(37, '\0');
  const struct {
    const char* what;
    std::string bytes;
    SurfaceFormat format;
  } files[] = {
      {"OBJ", continued, SurfaceFormat::obj},
      {"OFF", off, SurfaceFormat::off},
      {"PLY", ply("ascii"), SurfaceFormat::ply},
      {"PLY, little-endian", ply("binary_little_endian"), SurfaceFormat::ply},
      {"PLY, big-endian", ply("binary_big_endian"), SurfaceFormat::ply},
      {"STL", ascii, SurfaceFormat::stl},
      {"STL with a byte-order mark", "\xef\xbb\xbf" + ascii, SurfaceFormat::stl},
      {"STL with 'end loop'", parted, SurfaceFormat::stl},
      {"STL with commas", commas, SurfaceFormat::stl},
      {"binary STL", binary_stl(*cuboid), SurfaceFormat::stl},
      {"binary STL with a tail", "x" + binary_stl(*cuboid).substr(1) + tail, SurfaceFormat::stl}};
  for (const auto& file : files) {
    INFO(file.what);
    CHECK(surface_format(file.bytes) == file.format);
    const auto surface = read_surface(file.bytes);
    INFO((surface ? "" : surface.error().message));
    REQUIRE(surface);
    const auto solid = closed(*surface);
    REQUIRE(solid);
    CHECK(solid->volume == Approx(40000.0).epsilon(1e-6));
    CHECK(surface->ignored_bytes ==
          (file.bytes.ends_with(tail) && file.format == SurfaceFormat::stl ? 37 : 0));
  }
  for (const std::string& other : {std::string("mass(1.0,0.0,0.0),m;\n"), std::string("hello"),
                                   std::string("RIFF\0\0\0\0WAVE", 12), std::string()}) {
    CHECK(surface_format(other) == SurfaceFormat::unknown);
  }
  CHECK(read_surface("ply\nformat ascii 1.0\n").error().message.find("'end_header'") !=
        std::string::npos);
  CHECK(read_surface("OFF\n8 6 0\n0 0 0\n").error().message.find("three coordinates") !=
        std::string::npos);
  CHECK(read_surface("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
            .error()
            .message.find("from 0 to 2, found '7'") != std::string::npos);
}

TEST_CASE("OBJ faces with many corners and negative indices are read", "[surface]") {
  const auto cube = read_surface(
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
      "usemtl steel\nvn 0 0 1\nf 4 3 2 1\nf -4 -3 -2 -1\r\n"
      "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  REQUIRE(cube);
  const auto solid = closed(*cube);
  REQUIRE(solid);
  CHECK(solid->surface.triangles.size() == 12);
  CHECK(solid->volume == Approx(1.0).epsilon(1e-12));
}

TEST_CASE("unreadable files are reported with the line", "[surface]") {
  struct Case {
    std::string text;
    int line;
    std::string said;
  };
  const std::vector<Case> cases = {
      {"", 0, "expected a solid in STL"},
      {"solid x\nendsolid x\n", 2, "no 'facet'"},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 zero\n", 4,
       "expected three coordinates of at most 1e9, found 'zero'"},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n", 4, "found the end of the line"},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 1\n", 4, "end of the file"},
      {"solid x\nfacet\nouter ring\n", 3, "expected 'loop', found 'ring'"},
      {"solid x\nhello\n", 2, "expected 'facet' or 'endsolid', found 'hello'"},
      {"solid x\nfacet\nouter loop\nvertex 0 0 1e10\n", 4, "found '1e10'"},
      {"solid x\nfacet\nouter loop\nvertex nan 0 0\n", 4, "found 'nan'"},
      {std::string(80, 'x') + std::string("\x02\0\0\0", 4), 0, "expected a solid in STL"},
      {"v 0 0 0\nv 1 0 0\nf 1 2 3\n", 3, "from 1 to 2, found '3'"},
      {"v 0 0 0\nf 1 1\n", 2, "three corners or more"},
      {"v 0 0 0\nf 0 1 1\n", 2, "found '0'"},
      {"v 0 0 0\nf 1 1 x\n", 2, "found 'x'"},
      {"v 0 0 0\n", 1, "no face"},
      {"v 0 0\n", 1, "found the end of the line"},
  };
  for (const Case& one : cases) {
    const auto read = read_surface(one.text);
    INFO(one.text);
    REQUIRE_FALSE(read);
    INFO(read.error().message);
    CHECK(read.error().line == one.line);
    CHECK(read.error().message.find(one.said) != std::string::npos);
  }
}

TEST_CASE("an open surface names its edges", "[surface]") {
  Surface box = box_surface({1.0, 2.0, 3.0});
  box.triangles.pop_back();  // The triangle of corners 1, 7 and 5 on the side x = 1.
  const auto open = closed(box);
  REQUIRE_FALSE(open);
  const std::string& said = open.error().message;
  INFO(said);
  CHECK(said.find("not closed: 3 edges with a triangle on one side only") != std::string::npos);
  CHECK(said.find("(1, 0, 0) to (1, 0, 3)") != std::string::npos);
  CHECK(said.find("(1, 0, 3) to (1, 2, 3)") != std::string::npos);
  CHECK(said.find("(1, 0, 0) to (1, 2, 3)") != std::string::npos);

  // A wall on one edge of a box, which has three triangles.
  Surface walled = box_surface({1.0, 1.0, 1.0});
  walled.points.push_back({2.0, 2.0, 0.0});
  walled.triangles.push_back({3, 7, 8});
  const auto crowded = closed(walled);
  REQUIRE_FALSE(crowded);
  INFO(crowded.error().message);
  CHECK(crowded.error().message.find("1 edge with an odd number of triangles") !=
        std::string::npos);
  CHECK(crowded.error().message.find("(1, 1, 0) to (1, 1, 1)") != std::string::npos);

  // A thousand open edges are counted, and a dozen named.
  Surface torn = icosphere(3, 1.0, false);
  torn.triangles.resize(400);
  const auto many = closed(torn);
  REQUIRE_FALSE(many);
  CHECK(std::count(many.error().message.begin(), many.error().message.end(), '\n') == 13);
  CHECK(many.error().message.find(" more") != std::string::npos);
}

TEST_CASE("triangles are oriented outwards, and coincident points are welded", "[surface]") {
  Surface box = box_surface({1.0, 2.0, 3.0});
  Random random(3);
  std::size_t turned = 0;
  for (Triangle& triangle : box.triangles) {
    if (random.below(2) == 0) {
      std::swap(triangle[0], triangle[1]);
      ++turned;
    }
  }
  const auto solid = closed(box);
  REQUIRE(solid);
  CHECK(solid->volume == Approx(6.0).epsilon(1e-12));
  CHECK(solid->repairs.turned == turned);

  auto loose = read_surface(ascii_stl(box));  // Three points per triangle.
  REQUIRE(loose);
  for (Point3& point : loose->points) {
    point[0] += random.uniform(-1e-7, 1e-7);
  }
  const auto welded = closed(*loose);
  REQUIRE(welded);
  CHECK(welded->surface.points.size() == 8);
  CHECK(welded->repairs.welded == 28);

  // A degenerate triangle adds nothing.
  Surface sliver = box_surface({1.0, 1.0, 1.0});
  sliver.triangles.push_back({0, 1, 1});
  const auto thinned = closed(sliver);
  REQUIRE(thinned);
  CHECK(thinned->repairs.left_out == 1);
}

TEST_CASE("cavities face inwards, and the largest part is kept", "[surface]") {
  Surface shell = icosphere(2, 1.0, true);
  append(shell, icosphere(2, 0.5, true));  // Both face outwards, the inner one comes last.
  const auto hollow = closed(shell);
  REQUIRE(hollow);
  CHECK(hollow->shells == 2);
  CHECK(hollow->shell.front() == 0);
  CHECK(hollow->volume == Approx(4.0 / 3.0 * std::numbers::pi * 0.875).epsilon(1e-9));

  Surface inside_first = icosphere(2, 0.5, true);
  append(inside_first, icosphere(2, 1.0, true));
  const auto same = closed(inside_first);
  REQUIRE(same);
  CHECK(same->shell.back() == 0);
  CHECK(same->volume == Approx(hollow->volume).epsilon(1e-12));

  // A ball with a box beside it, and with a loose ball in its cavity.
  Surface apart = icosphere(2, 1.0, true);
  append(apart, box_surface({1.0, 1.0, 1.0}, {3.0, 0.0, 0.0}));
  const auto two = closed(apart);
  REQUIRE(two);
  CHECK(two->repairs.parts == 1);
  CHECK(two->repairs.parts_area == Approx(6.0 / (6.0 + 4.0 * std::numbers::pi)).epsilon(0.02));
  CHECK(two->volume == Approx(4.0 / 3.0 * std::numbers::pi).epsilon(1e-9));
  append(shell, icosphere(1, 0.2, true));
  const auto rattle = closed(shell);
  REQUIRE(rattle);
  CHECK(rattle->shells == 2);
  CHECK(rattle->repairs.parts == 1);
  CHECK(rattle->volume == Approx(hollow->volume).epsilon(1e-12));
}

TEST_CASE("small holes are closed, and repeated triangles are dropped", "[surface]") {
  const Surface ball = icosphere(2, 1.0, true);
  Surface torn = ball;
  torn.triangles.erase(torn.triangles.begin() + 7);
  torn.triangles.erase(torn.triangles.begin() + 200);
  torn.triangles.push_back(torn.triangles.front());
  torn.triangles.push_back({torn.triangles[1][1], torn.triangles[1][0], torn.triangles[1][2]});
  const auto whole = closed(torn);
  REQUIRE(whole);
  CHECK(whole->repairs.holes == 2);
  CHECK(whole->repairs.left_out == 2);
  CHECK(whole->repairs.turned == 0);
  // The middle of a triangle lies in its plane.
  CHECK(whole->volume == Approx(4.0 / 3.0 * std::numbers::pi).epsilon(1e-12));
  // The sides of its triangles are about 0.3, and the ball's size is its diagonal, 2 sqrt(3).
  CHECK(whole->repairs.longest_hole == Approx(0.9 / 3.5).epsilon(0.2));

  // A loose triangle beside a closed solid is left out.
  Surface loose = ball;
  loose.points.insert(loose.points.end(), {{2, 0, 0}, {2, 1, 0}, {2, 2, 2}});
  const int count = static_cast<int>(ball.points.size());
  loose.triangles.push_back({count, count + 1, count + 2});
  const auto solid = closed(loose);
  REQUIRE(solid);
  CHECK(solid->repairs.parts == 1);
  CHECK(solid->surface.triangles.size() == ball.triangles.size());

  // A bowl is no solid with a hole.
  Surface bowl = ball;
  std::erase_if(bowl.triangles, [&](const Triangle& triangle) {
    return std::all_of(triangle.begin(), triangle.end(), [&](int corner) {
      return ball.points[static_cast<std::size_t>(corner)][2] > 0.0;
    });
  });
  CHECK_FALSE(closed(bowl));
  const auto sheet = repaired_sheet(bowl, Progress());
  REQUIRE(sheet);
  CHECK(sheet->surface.triangles.size() == bowl.triangles.size());
}

TEST_CASE("solids that touch along an edge are two parts", "[surface]") {
  // The four triangles of the common edge are paired so that material lies between them, in
  // either order of the two.
  for (const bool is_larger_first : {false, true}) {
    const Surface larger = box_surface({1.0, 2.0, 1.0});
    const Surface smaller = box_surface({1.0, 1.0, 1.0}, {1.0, 2.0, 0.0});
    Surface touching = is_larger_first ? larger : smaller;
    append(touching, is_larger_first ? smaller : larger);
    const auto kept = closed(touching);
    REQUIRE(kept);
    CHECK(kept->volume == Approx(2.0).epsilon(1e-12));
    CHECK(kept->repairs.parts == 1);
    // A sheet is connected there.
    const auto sheet = repaired_sheet(touching, Progress());
    REQUIRE(sheet);
    CHECK(sheet->repairs.parts == 0);
    CHECK(sheet->surface.triangles.size() == 24);
  }
}

// A box from a corner without the two triangles of its top.
Surface open_box(const Point3& sides, const Point3& corner) {
  Surface box = box_surface(sides, corner);
  std::erase_if(box.triangles, [&](const Triangle& triangle) {
    return std::all_of(triangle.begin(), triangle.end(), [&](int point) {
      return box.points[static_cast<std::size_t>(point)][2] == corner[2] + sides[2];
    });
  });
  return box;
}

TEST_CASE("holes that touch at a point are closed one by one", "[surface]") {
  // Two open boxes share one point of their rims. Each rim has a length of 4 and of 3.2, and the
  // size is the length of (1.8, 1.8, 4), 4.74. The fans lie in the tops.
  for (const bool is_larger_first : {false, true}) {
    const Surface larger = open_box({1.0, 1.0, 4.0}, {0.0, 0.0, 0.0});
    const Surface smaller = open_box({0.8, 0.8, 2.0}, {1.0, 1.0, 2.0});
    Surface boxes = is_larger_first ? larger : smaller;
    append(boxes, is_larger_first ? smaller : larger);
    const auto kept = closed(boxes);
    REQUIRE(kept);
    CHECK(kept->repairs.holes == 2);
    CHECK(kept->repairs.longest_hole == Approx(4.0 / std::hypot(1.8, 1.8, 4.0)).epsilon(1e-12));
    CHECK(kept->repairs.parts == 1);
    CHECK(kept->volume == Approx(4.0).epsilon(1e-12));
    CHECK(kept->surface.triangles.size() == 14);
  }

  // The sides of the top of a box are joined to its middle. Two opposite triangles of the four are
  // missing, and the edges of the holes are an eight. A triangle's edge is 1 + sqrt(2).
  Surface box = open_box({1.0, 1.0, 3.0}, {0.0, 0.0, 0.0});
  const auto corner = [&](double x, double y) {
    return static_cast<int>(std::find(box.points.begin(), box.points.end(), Point3{x, y, 3.0}) -
                            box.points.begin());
  };
  const int middle = static_cast<int>(box.points.size());
  box.triangles.push_back({corner(0.0, 0.0), corner(1.0, 0.0), middle});
  box.triangles.push_back({corner(1.0, 1.0), corner(0.0, 1.0), middle});
  box.points.push_back({0.5, 0.5, 3.0});
  const auto whole = closed(box);
  REQUIRE(whole);
  CHECK(whole->repairs.holes == 2);
  CHECK(whole->repairs.longest_hole == Approx((1.0 + std::sqrt(2.0)) / std::sqrt(11.0)));
  CHECK(whole->volume == Approx(3.0).epsilon(1e-12));

  // A fin on an edge of a box gives the edge three triangles. A second side closes the fin.
  Surface finned = box_surface({3.0, 3.0, 1.0});
  finned.points.push_back({3.1, 3.1, 0.5});
  finned.triangles.push_back({3, 7, 8});
  const auto box_alone = closed(finned);
  REQUIRE(box_alone);
  CHECK(box_alone->volume == Approx(9.0).epsilon(1e-12));
}

TEST_CASE("one-sided surfaces and surfaces without volume are rejected", "[surface]") {
  // A projective plane: the six points of half an icosahedron, all joined. Every edge has two
  // triangles, and the surface cannot be oriented.
  Surface plane;
  plane.points = {{0, 0, 1},      {1, 0, 0},       {0.3, 0.9, 0},
                  {-0.8, 0.6, 0}, {-0.8, -0.6, 0}, {0.3, -0.9, 0}};
  plane.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}, {0, 5, 1},
                     {1, 2, 4}, {2, 3, 5}, {3, 4, 1}, {4, 5, 2}, {5, 1, 3}};
  const auto one_side = closed(plane);
  REQUIRE_FALSE(one_side);
  INFO(one_side.error().message);
  CHECK(one_side.error().message.find("one-sided") != std::string::npos);

  Surface flat = box_surface({1.0, 1.0, 0.0});
  const auto nothing = closed(flat);
  REQUIRE_FALSE(nothing);
}

TEST_CASE("random bytes do not crash the reader", "[surface]") {
  const Surface ball = icosphere(1, 1.0, false);
  const std::vector<std::string> seeds = {ascii_stl(ball), binary_stl(ball), obj(ball)};
  Random random(20261122);
  std::size_t read = 0;
  std::size_t whole = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string bytes = seeds[static_cast<std::size_t>(round) % 3];
    const std::size_t changes = random.below(6);
    for (std::size_t i = 0; i < changes && !bytes.empty(); ++i) {
      const std::size_t place = random.below(bytes.size());
      const std::size_t other = random.below(bytes.size());
      switch (random.below(5)) {
        case 0:
          bytes[place] = static_cast<char>(random.below(256));
          break;
        case 1:
          bytes.erase(place, random.below(40));
          break;
        case 2:
          bytes.insert(place, bytes.substr(other, random.below(80)));
          break;
        case 3:
          bytes.resize(place);
          break;
        case 4:
          bytes.insert(place, "-999999999999999999999 1e400 nan -inf f v solid ");
          break;
      }
    }
    const auto surface = read_surface(bytes);
    if (!surface) {
      CHECK_FALSE(surface.error().message.empty());
      continue;
    }
    ++read;
    for (const Triangle& triangle : surface->triangles) {
      for (const int point : triangle) {
        REQUIRE(point >= 0);
        REQUIRE(static_cast<std::size_t>(point) < surface->points.size());
      }
    }
    const auto solid = closed(*surface);
    whole += solid ? 1 : 0;
    if (solid) {
      CHECK(solid->volume > 0.0);
    } else {
      CHECK_FALSE(solid.error().message.empty());
    }
  }
  CHECK(read > 500);  // Some inputs must be accepted for the test to mean anything.
  CHECK(whole > 200);
}

}  // namespace
}  // namespace ressort::surface_test
