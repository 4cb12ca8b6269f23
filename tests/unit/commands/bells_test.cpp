// The church bells among the models against the bells that they are: solids of their profiles,
// filled with tetrahedra by gmsh and solved by the finite elements of `ressort body`.
#include "tests/support/bells.h"

#include <complex>
#include <cstdlib>
#include <map>
#include <string_view>

#include "app/commands/body/mesher.h"
#include "app/session/files.h"
#include "core/solids/solid_modes.h"
#include "tests/support/harness.h"

namespace ressort {
namespace {

using namespace support;

// The partials of a model with hum, prime and so on in its order: pairs by their mean.
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

// Of how many meridians a mode is: what is the largest of its radial motion around the axis.
int meridians(const SolidMesh& mesh, const SolidModes& modes, std::size_t mode) {
  std::array<std::complex<double>, 12> around{};
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const double x = mesh.points[i][0];
    const double y = mesh.points[i][1];
    const double r = std::hypot(x, y);
    if (r < 0.2) {
      continue;  // the crown
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

// Hum, prime, tierce, quint, nominal, and the lowest of five meridians. Hz
std::vector<double> partials_of_solid(const BellProfile& profile) {
  const auto closed = close_surface(bell_surface(profile, 80, 120), Progress());
  REQUIRE(closed);
  const auto filled = fill_with_tetrahedra(*closed, {.mesher = Mesher::gmsh, .unknowns = 90000.0},
                                           [] { return true; });
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
  for (const auto& [m, which] :
       {std::pair<int, std::size_t>(2, 0), std::pair<int, std::size_t>(2, 1),
        std::pair<int, std::size_t>(3, 0), std::pair<int, std::size_t>(3, 1),
        std::pair<int, std::size_t>(4, 0), std::pair<int, std::size_t>(5, 0)}) {
    REQUIRE(found[m].size() > 2 * which + 1);
    partials.push_back(0.5 * (found[m][2 * which] + found[m][2 * which + 1]));
  }
  return partials;
}

}  // namespace

TEST_CASE("a church bell has the partials that bells are tuned to", "[bells]") {
  for (const auto& [name, third] : {std::pair("ChurchBell", 1.2), std::pair("MajorBell", 1.25)}) {
    const std::vector<double> partials = partials_of(name);
    const double wanted[] = {0.5, 1.0, third, 1.5, 2.0};
    for (std::size_t i = 0; i < std::size(wanted); ++i) {
      INFO(name << ", partial " << i);
      CHECK(2.0 * partials[i] / partials[4] == Approx(wanted[i]).epsilon(2e-3));
    }
  }
}

TEST_CASE("the church bells' partials are those of their solids", "[.][bells_everywhere]") {
  if (std::system("command -v gmsh >/dev/null 2>&1") != 0) {
    WARN("not run: no gmsh");
    return;
  }
  for (const auto& [name, profile] : bells) {
    const std::vector<double> solid = partials_of_solid(profile);
    const std::vector<double> partials = partials_of(name);
    const std::size_t places[] = {0, 1, 2, 3, 4, 7};  // among the model's
    for (std::size_t i = 0; i < solid.size(); ++i) {
      const double of_model = partials[places[i]] / partials[4];
      INFO(name << ", partial " << places[i] << ": " << of_model << ", of the solid "
                << solid[i] / solid[4]);
      // The prime, in which the wall is stretched, is the last to converge: that of MajorBell is
      // 1.7 % off with so many unknowns, 3.3 % with a third of them.
      const bool is_late = name == std::string_view("MajorBell") && places[i] == 1;
      CHECK(of_model == Approx(solid[i] / solid[4]).epsilon(is_late ? 0.018 : 0.01));
    }
  }
}

}  // namespace ressort
