// Compares the bell models with their solids: their profiles, meshed by gmsh and solved by the
// finite elements of `ressort body`.
#include "tests/support/bells.h"

#include <complex>
#include <cstdlib>
#include <map>
#include <string_view>

#include "app/commands/body/mesher.h"
#include "app/session/files.h"
#include "core/solids/solid_modes.h"
#include "tests/support/harness.h"

namespace ressort::bells_test {
namespace {

using namespace support;

// Partials of a model in the order hum, prime, tierce and so on; pairs are averaged.
std::vector<double> partials_of(const std::string& name) {
  const auto text = read_text(std::string(RESSORT_SOURCE) + "/models/" + name + ".mdl", 1 << 20);
  REQUIRE(text);
  const Network network = network_of(*text);
  std::vector<double> hz;
  for (const BodyMode& mode : network.modes) {
    hz.push_back(argument_value(network, mode.frequency_hz, parameter_values(network)));
  }
  std::vector<double> partials = {hz[0]};
  for (std::size_t i = 1; i + 1 < hz.size(); i += 2) {
    partials.push_back(0.5 * (hz[i] + hz[i + 1]));
  }
  return partials;
}

// Number of nodal meridians of a mode: the largest Fourier component of the radial motion around
// the axis. The crown is excluded, because it turns in some modes.
int meridians(const SolidMesh& mesh, const SolidModes& modes, std::size_t mode) {
  std::array<std::complex<double>, 12> around{};
  double widest = 0.0;
  for (const Point3& point : mesh.points) {
    widest = std::max(widest, std::hypot(point[0], point[1]));
  }
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const double x = mesh.points[i][0];
    const double y = mesh.points[i][1];
    const double r = std::hypot(x, y);
    if (r < 0.4 * widest) {
      continue;
    }
    const double radial = (x * modes.shapes(3 * i, mode) + y * modes.shapes(3 * i + 1, mode)) / r;
    for (std::size_t m = 0; m < around.size(); ++m) {
      around[m] += radial * std::polar(1.0, static_cast<double>(m) * std::atan2(y, x));
    }
  }
  const auto largest = std::max_element(around.begin(), around.end(),
                                        [](auto a, auto b) { return std::abs(a) < std::abs(b); });
  return static_cast<int>(largest - around.begin());
}

// Partials in the table of the bell, Hz.
std::vector<double> partials_of_solid(const Bell& bell) {
  const auto closed = close_surface(bell_surface(bell.profile, 80, 120), Progress());
  REQUIRE(closed);
  const auto filled = fill_with_tetrahedra(*closed, {.mesher = Mesher::gmsh, .unknowns = 90000.0},
                                           [](std::string_view) { return true; });
  REQUIRE(filled);
  const auto mesh = quadratic(filled->mesh);
  REQUIRE(mesh);
  const SolidMaterial bronze{"", 1.1e11, 0.34, 8700.0, 0.0};
  const auto modes = find_solid_modes(*mesh, bronze, {}, 30, Progress());
  REQUIRE(modes);
  std::map<int, std::vector<double>> found;  // [meridians] each of a pair
  for (std::size_t i = 0; i < modes->frequency_hz.size(); ++i) {
    found[meridians(*mesh, *modes, i)].push_back(modes->frequency_hz[i]);
  }
  std::vector<double> partials;
  for (const auto& [m, from_below, place] : bell.partials) {
    REQUIRE(found[m].size() > 2 * from_below + 1);
    partials.push_back(0.5 * (found[m][2 * from_below] + found[m][2 * from_below + 1]));
  }
  return partials;
}

}  // namespace

TEST_CASE("A church bell has the partials that bells are tuned to", "[bells]") {
  for (const auto& [name, third] :
       {std::pair("ChurchBell", 1.2), std::pair("MajorBell", 1.25), std::pair("Bourdon", 1.2)}) {
    const std::vector<double> partials = partials_of(name);
    const double wanted[] = {0.5, 1.0, third, 1.5, 2.0};
    for (std::size_t i = 0; i < std::size(wanted); ++i) {
      INFO(name << ", partial " << i);
      CHECK(2.0 * partials[i] / partials[4] == Approx(wanted[i]).epsilon(2e-3));
    }
  }
}

TEST_CASE("A handbell has a twelfth above its lowest partial", "[bells]") {
  const std::vector<double> partials = partials_of("HandBell");
  CHECK(partials[1] == Approx(3.0 * partials[0]).epsilon(2e-3));
}

TEST_CASE("Partials of the bells are those of their solids", "[.][bells_everywhere]") {
  if (std::system("command -v gmsh >/dev/null 2>&1") != 0) {
    WARN("not run: no gmsh");
    return;
  }
  for (const Bell& bell : bells) {
    const std::vector<double> solid = partials_of_solid(bell);
    const std::vector<double> partials = partials_of(bell.name);
    for (std::size_t i = 1; i < solid.size(); ++i) {
      const std::size_t place = bell.partials[i].place;
      const double of_model = partials[place] / partials[bell.partials[0].place];
      const double of_solid = solid[i] / solid[0];
      INFO(bell.name << ", partial " << place << ": " << of_model << ", of the solid " << of_solid);
      // The prime stretches the wall and is the last to converge: the prime of MajorBell is 1.7 %
      // off with this many unknowns, and 3.3 % with a third of them.
      const bool is_late = bell.name == std::string_view("MajorBell") && place == 1;
      CHECK(of_model == Approx(of_solid).epsilon(is_late ? 0.018 : 0.01));
    }
  }
}

}  // namespace ressort::bells_test
