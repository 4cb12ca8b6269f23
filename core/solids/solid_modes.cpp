#include "core/solids/solid_modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linear_algebra/lanczos.h"
#include "core/ranges.h"
#include "core/solids/shell.h"

namespace ressort::solids {
namespace {

constexpr int rigid_motions = 6;
// Share of the shift below which omega^2 belongs to a rigid-body motion.
constexpr double rigid_share = 1e-6;

// Computes y = M x for three axes and all columns at once. The columns are interleaved while it
// works.
void times_mass(const SparseMatrix& mass, Matrix& columns) {
  const std::size_t rows = columns.rows();
  const std::size_t count = columns.columns();
  const std::size_t width = 3 * count;
  std::vector<double> x(columns.values.size());
  std::vector<double> y(columns.values.size());
  const auto place = [&](std::size_t row, std::size_t column) {
    return row / 3 * width + 3 * column + row % 3;
  };
  for (std::size_t c = 0; c < count; ++c) {
    for (std::size_t row = 0; row < rows; ++row) {
      x[place(row, c)] = columns.values[row + c * rows];
    }
  }
  for (int column = 0; column < mass.size(); ++column) {
    const double* const from = &x[at(column) * width];
    double* const to = &y[at(column) * width];
    const int first = mass.first[at(column)];
    for (std::size_t k = 0; k < width; ++k) {
      to[k] += mass.value[at(first)] * from[k];
    }
    for (int i = first + 1; i < mass.first[at(column) + 1]; ++i) {
      const double m = mass.value[at(i)];
      const double* const below = &x[at(mass.row[at(i)]) * width];
      double* const to_below = &y[at(mass.row[at(i)]) * width];
      for (std::size_t k = 0; k < width; ++k) {
        to[k] += m * below[k];
        to_below[k] += m * from[k];
      }
    }
  }
  for (std::size_t c = 0; c < count; ++c) {
    for (std::size_t row = 0; row < rows; ++row) {
      columns.values[row + c * rows] = y[place(row, c)];
    }
  }
}

void times_stiffness(const SolidMatrices& matrices, Matrix& columns) {
  const std::size_t rows = columns.rows();
  const SparseMatrix& mass = matrices.mass;
  Vector y(columns.values.size());
  for (std::size_t c = 0; c < columns.columns(); ++c) {
    const double* const x = &columns.values[c * rows];
    double* const to = &y[c * rows];
    for (int column = 0; column < mass.size(); ++column) {
      for (int i = mass.first[at(column)]; i < mass.first[at(column) + 1]; ++i) {
        const std::size_t row = 3 * at(mass.row[at(i)]);
        const NodeBlock& block = matrices.stiffness[at(i)];
        for (std::size_t b = 0; b < 3; ++b) {
          for (std::size_t a = 0; a < 3; ++a) {
            to[row + a] += block[a + 3 * b] * x[3 * at(column) + b];
            to[3 * at(column) + b] += row == 3 * at(column) ? 0.0 : block[a + 3 * b] * x[row + a];
          }
        }
      }
    }
  }
  columns.values = std::move(y);
}

// Gradients of the ten shape functions at a point with barycentric coordinates L.
using Gradients = std::array<Point3, 10>;

Gradients gradients_at(const std::array<Point3, 4>& corner, const std::array<double, 4>& share) {
  Gradients gradients;
  for (std::size_t i = 0; i < 4; ++i) {
    gradients[i] = (4.0 * share[i] - 1.0) * corner[i];
  }
  for (std::size_t e = 0; e < 6; ++e) {
    const auto [i, j] = tetrahedron_edges[e];
    gradients[4 + e] = 4.0 * (share[i] * corner[j] + share[j] * corner[i]);
  }
  return gradients;
}

// Integral of N_a N_b over an element of volume 1, from int L1^a L2^b L3^c L4^d = 6 V a! b! c! d! /
// (a+b+c+d+3)!.
double mass_share(std::size_t a, std::size_t b) {
  const auto touches = [](std::size_t edge, std::size_t corner) {
    return tetrahedron_edges[edge][0] == corner || tetrahedron_edges[edge][1] == corner;
  };
  if (a < 4 && b < 4) {
    return (a == b ? 6.0 : 1.0) / 420.0;
  }
  if (a < 4 || b < 4) {
    return (touches(std::max(a, b) - 4, std::min(a, b)) ? -4.0 : -6.0) / 420.0;
  }
  const int common = (touches(a - 4, tetrahedron_edges[b - 4][0]) ? 1 : 0) +
                     (touches(a - 4, tetrahedron_edges[b - 4][1]) ? 1 : 0);
  return (common == 2 ? 32.0 : common == 1 ? 16.0 : 8.0) / 420.0;
}

// The nodes of a shell's triangle: three displacements and three rotations.
using ShellNodes = std::array<int, 6>;

std::vector<ShellNodes> shell_nodes(const SolidMesh& mesh) {
  std::vector<ShellNodes> nodes;
  const int half = static_cast<int>(mesh.points.size() / 2);
  for (const auto& [a, b, c] : mesh.surface) {
    nodes.push_back({a, b, c, half + a, half + b, half + c});
  }
  return nodes;
}

// Returns the coupling pattern of the free nodes, all values 0.
template <class Elements>
SparseMatrix pattern_of(const Elements& elements, const std::vector<int>& row_of, int rows) {
  std::vector<std::vector<int>> below(at(rows));
  for (const auto& element : elements) {
    for (const int a : element) {
      for (const int b : element) {
        const int row = row_of[at(a)];
        const int column = row_of[at(b)];
        if (column >= 0 && row > column) {
          below[at(column)].push_back(row);
        }
      }
    }
  }
  SparseMatrix pattern(rows, {});
  pattern.row.clear();
  pattern.value.clear();
  for (int column = 0; column < rows; ++column) {
    std::vector<int>& list = below[at(column)];
    std::ranges::sort(list);
    list.erase(std::unique(list.begin(), list.end()), list.end());
    pattern.first[at(column)] = static_cast<int>(pattern.row.size());
    pattern.row.push_back(column);
    pattern.row.insert(pattern.row.end(), list.begin(), list.end());
    std::vector<int>().swap(list);
  }
  pattern.first[at(rows)] = static_cast<int>(pattern.row.size());
  pattern.value.assign(pattern.row.size(), 0.0);
  return pattern;
}

// Returns a shift below all modes of a solid of this size: (omega of a twentieth of the travel time
// of sound through it)^2. The modes of a shell are the lower, the thinner its wall is.
double shift_of(const SolidMesh& mesh, const SolidMaterial& material) {
  const double size = box_around(mesh.points).diagonal();
  const double thinness = mesh.thickness > 0.0 ? std::min(1.0, 10.0 * mesh.thickness / size) : 1.0;
  const double omega = 0.05 * thinness * std::sqrt(material.young / material.density) / size;
  return -omega * omega;
}

void assemble_shell(const SolidMesh& mesh, const SolidMaterial& material,
                    const std::vector<int>& row_of, SolidMatrices& matrices,
                    const Progress& progress) {
  for (const ShellNodes& nodes : shell_nodes(mesh)) {
    progress.spend(2000);
    const ShellElement element = shell_element(
        {mesh.points[at(nodes[0])], mesh.points[at(nodes[1])], mesh.points[at(nodes[2])]}, material,
        mesh.thickness);
    const double turning = mesh.thickness * mesh.thickness / 12.0;
    for (std::size_t a = 0; a < 6; ++a) {
      for (std::size_t b = 0; b < 6; ++b) {
        const int row = row_of[at(nodes[a])];
        const int column = row_of[at(nodes[b])];
        if (column < 0 || row < column) {
          continue;
        }
        const std::size_t i = matrices.mass.find(row, column);
        if (a / 3 == b / 3) {
          // Two parts of mass at the corners and one part spread linearly: its mean error is less
          // than that of either.
          matrices.mass.value[i] +=
              element.mass / 36.0 * (a == b ? 10.0 : 1.0) * (a < 3 ? 1.0 : turning);
        }
        for (std::size_t k = 0; k < 9; ++k) {
          matrices.stiffness[i][k] += element.stiffness[a][b][k];
        }
      }
    }
  }
}

double mass_of(const SolidMesh& mesh, const SolidMaterial& material) {
  double volume = 0.0;
  for (const QuadraticTetrahedron& element : mesh.elements) {
    const Point3& origin = mesh.points[at(element[0])];
    volume +=
        inner(mesh.points[at(element[1])] - origin,
              cross(mesh.points[at(element[2])] - origin, mesh.points[at(element[3])] - origin)) /
        6.0;
  }
  for (std::size_t t = 0; mesh.thickness > 0.0 && t < mesh.surface.size(); ++t) {
    const auto& [a, b, c] = mesh.surface[t];
    const Point3& origin = mesh.points[at(a)];
    volume += 0.5 * mesh.thickness *
              length(cross(mesh.points[at(b)] - origin, mesh.points[at(c)] - origin));
  }
  return material.density * volume;
}

}  // namespace

std::span<const SolidMaterial> solid_materials() {
  // Moduli and densities from handbooks. Loss factors vary by a factor of ten between specimens.
  static constexpr SolidMaterial table[] = {
      {"steel", 200e9, 0.29, 7850.0, 2.5e-4},
      {"iron", 210e9, 0.28, 8000.0, 5e-4},
      {"bronze", 105e9, 0.33, 8600.0, 2e-4},
      {"brass", 105e9, 0.34, 8500.0, 4e-4},
      {"aluminium", 70e9, 0.33, 2700.0, 3e-4},
      {"tin", 50e9, 0.325, 7265.0, 1e-3},
      {"glass", 70e9, 0.22, 2500.0, 1e-3},
      {"ceramic", 72e9, 0.19, 2700.0, 2e-3},
      {"wood", 11e9, 0.25, 750.0, 1e-2},
      {"rosewood", 20e9, 0.35, 850.0, 6e-3},
      {"polycarbonate", 2.4e9, 0.37, 1190.0, 2e-2},
      {"plastic", 1.4e9, 0.35, 1070.0, 2e-2},
  };
  return table;
}

std::optional<SolidMaterial> solid_material(std::string_view name) {
  for (const SolidMaterial& material : solid_materials()) {
    if (material.name == name) {
      return material;
    }
  }
  return std::nullopt;
}

double SolidDamping::t60_s(double frequency_hz) const {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  return 2.0 * std::log(1000.0) / (a + b * omega * omega + loss * omega);
}

bool is_clamped(const Point3& point, std::span<const SolidClamp> clamps) {
  return std::ranges::any_of(clamps, [&](const SolidClamp& clamp) {
    return length(point - clamp.centre) <= clamp.radius;
  });
}

SolidMatrices solid_matrices(const SolidMesh& mesh, const SolidMaterial& material,
                             std::span<const SolidClamp> clamps, const Progress& progress) {
  std::vector<int> row_of(mesh.points.size(), -1);
  std::vector<int> node;
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    if (!is_clamped(mesh.points[i], clamps)) {
      row_of[i] = static_cast<int>(node.size());
      node.push_back(static_cast<int>(i));
    }
  }
  const int rows = static_cast<int>(node.size());
  const bool is_shell = mesh.thickness > 0.0;
  SolidMatrices matrices{is_shell ? pattern_of(shell_nodes(mesh), row_of, rows)
                                  : pattern_of(mesh.elements, row_of, rows),
                         {},
                         node};
  matrices.stiffness.assign(matrices.mass.row.size(), NodeBlock{});
  if (is_shell) {
    assemble_shell(mesh, material, row_of, matrices, progress);
    return matrices;
  }
  const double lambda = material.young * material.poisson /
                        ((1.0 + material.poisson) * (1.0 - 2.0 * material.poisson));
  const double mu = material.young / (2.0 * (1.0 + material.poisson));
  for (const QuadraticTetrahedron& element : mesh.elements) {
    progress.spend(2000);
    const Point3& origin = mesh.points[at(element[0])];
    const std::array<Point3, 3> side = {mesh.points[at(element[1])] - origin,
                                        mesh.points[at(element[2])] - origin,
                                        mesh.points[at(element[3])] - origin};
    const double six = inner(side[0], cross(side[1], side[2]));
    std::array<Point3, 4> slope;  // Gradients of the barycentric coordinates.
    for (std::size_t i = 0; i < 3; ++i) {
      slope[i + 1] = 1.0 / six * cross(side[(i + 1) % 3], side[(i + 2) % 3]);
    }
    slope[0] = -1.0 * (slope[1] + slope[2] + slope[3]);
    const double volume = six / 6.0;
    // Four-point quadrature, exact for polynomials of second degree, such as products of the
    // gradients.
    constexpr double high = 0.58541019662496845446;
    constexpr double low = 0.13819660112501051518;
    std::array<Gradients, 4> gradients;
    for (std::size_t q = 0; q < 4; ++q) {
      std::array<double, 4> share = {low, low, low, low};
      share[q] = high;
      gradients[q] = gradients_at(slope, share);
    }
    for (std::size_t a = 0; a < 10; ++a) {
      for (std::size_t b = 0; b < 10; ++b) {
        const int row = row_of[at(element[a])];
        const int column = row_of[at(element[b])];
        if (column < 0 || row < column) {
          continue;
        }
        const std::size_t i = matrices.mass.find(row, column);
        matrices.mass.value[i] += material.density * volume * mass_share(a, b);
        NodeBlock& block = matrices.stiffness[i];
        for (std::size_t q = 0; q < 4; ++q) {
          const Point3& ga = gradients[q][a];
          const Point3& gb = gradients[q][b];
          const double shear = mu * inner(ga, gb);
          for (std::size_t y = 0; y < 3; ++y) {
            for (std::size_t x = 0; x < 3; ++x) {
              block[x + 3 * y] +=
                  0.25 * volume *
                  (lambda * ga[x] * gb[y] + mu * ga[y] * gb[x] + (x == y ? shear : 0.0));
            }
          }
        }
      }
    }
  }
  return matrices;
}

Result<Eigenpairs> lowest_solid_pairs(const SolidMesh& mesh, const SolidMatrices& matrices,
                                      double shift, int count, const Progress& progress) {
  const int rows = matrices.mass.size();
  if (rows == 0) {
    return Error{"all of its nodes are clamped; make the clamps smaller"};
  }
  const auto places = mapped(matrices.node, [&](int node) { return mesh.points[at(node)]; });
  progress.stage("ordering its equations");
  FrontalCholesky factor(matrices.mass, places, progress);
  if (factor.size() > most_factor_elements) {
    return Error{std::to_string(3 * rows) + " unknowns are too many: the solution needs " +
                 std::to_string(std::lround(factor.size() * 8e-9)) + " GB; use a coarser mesh"};
  }
  progress.stage("factoring its stiffness");
  std::vector<NodeBlock> shifted = matrices.stiffness;
  for (std::size_t i = 0; i < shifted.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      shifted[i][4 * axis] -= shift * matrices.mass.value[i];
    }
  }
  if (!factor.factor(matrices.mass, shifted, progress)) {
    return Error{
        "its stiffness is not positive: a tetrahedron may be nearly flat, or Poisson's "
        "ratio too near to 0.5"};
  }
  progress.stage("finding its modes");
  auto pairs = lowest_pairs(
      shift, std::min(count, 3 * rows), 3 * rows, [&](Matrix& x) { factor.solve(x); },
      [&](Matrix& x) { times_mass(matrices.mass, x); }, progress);
  if (!pairs) {
    return Error{"its modes were not found: the iteration does not converge"};
  }
  return *std::move(pairs);
}

Result<SolidModes> find_solid_modes(const SolidMesh& mesh, const SolidMaterial& material,
                                    std::span<const SolidClamp> clamps, int count,
                                    const Progress& progress) {
  progress.stage("assembling its elements");
  const SolidMatrices matrices = solid_matrices(mesh, material, clamps, progress);
  const double shift = shift_of(mesh, material);
  const bool is_free = matrices.node.size() == mesh.points.size();
  // A solid clamped at a point or along a line can still rotate, so rigid motions are sought, too.
  const auto pairs = lowest_solid_pairs(mesh, matrices, shift, count + rigid_motions, progress);
  if (!pairs) {
    return pairs.error();
  }
  SolidModes modes;
  modes.rigid = is_free ? rigid_motions
                        : static_cast<int>(std::ranges::count_if(pairs->values, [&](double value) {
                            return std::abs(value) < rigid_share * std::abs(shift);
                          }));
  if (at(modes.rigid) >= pairs->values.size()) {
    return Error{"no part of it can bend"};
  }
  modes.mass = mass_of(mesh, material);
  const std::size_t found = pairs->values.size() - at(modes.rigid);
  const std::size_t kept = std::min(found, at(count));
  const std::size_t size = pairs->vectors.rows();
  Matrix stiff(size, kept);
  stiff.values = pairs->vectors.values[std::slice(size * at(modes.rigid), size * kept, 1)];
  const Matrix vectors = stiff;
  Matrix heavy = stiff;
  times_stiffness(matrices, stiff);
  times_mass(matrices.mass, heavy);
  modes.shapes = Matrix(3 * mesh.points.size(), kept);
  for (std::size_t k = 0; k < kept; ++k) {
    const double value = pairs->values[k + at(modes.rigid)];
    modes.frequency_hz.push_back(std::sqrt(value) / (2.0 * std::numbers::pi));
    const Vector kx = stiff.column(k);
    const Vector rest = kx - value * heavy.column(k);
    modes.residual = std::max(modes.residual, std::sqrt(dot(rest, rest) / dot(kx, kx)));
    for (std::size_t j = 0; j <= k; ++j) {
      modes.skewness = std::max(
          modes.skewness, std::abs(dot(vectors.column(k), heavy.column(j)) - (j == k ? 1.0 : 0.0)));
    }
    for (std::size_t row = 0; row < matrices.node.size(); ++row) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        modes.shapes(3 * at(matrices.node[row]) + axis, k) = vectors(3 * row + axis, k);
      }
    }
  }
  return modes;
}

std::vector<Point3> surface_normals(const SolidMesh& mesh) {
  std::vector<Point3> normals(mesh.points.size());
  for (const Triangle& triangle : mesh.surface) {
    const Point3& a = mesh.points[at(triangle[0])];
    const Point3 area = cross(mesh.points[at(triangle[1])] - a, mesh.points[at(triangle[2])] - a);
    for (const int corner : triangle) {
      normals[at(corner)] = normals[at(corner)] + area;
    }
  }
  for (Point3& normal : normals) {
    const double size = length(normal);
    normal = size > 0.0 ? 1.0 / size * normal : Point3{};
  }
  return normals;
}

int nearest_on_surface(const SolidMesh& mesh, const Point3& point) {
  int nearest = mesh.surface.front().front();
  for (const Triangle& triangle : mesh.surface) {
    for (const int corner : triangle) {
      if (length(mesh.points[at(corner)] - point) < length(mesh.points[at(nearest)] - point)) {
        nearest = corner;
      }
    }
  }
  return nearest;
}

std::vector<int> spread_on_surface(const SolidMesh& mesh, std::span<const SolidClamp> clamps,
                                   int count) {
  std::vector<int> nodes;
  for (const Triangle& triangle : mesh.surface) {
    nodes.insert(nodes.end(), triangle.begin(), triangle.end());
  }
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  std::erase_if(nodes, [&](int node) { return is_clamped(mesh.points[at(node)], clamps); });
  const Box3 box = box_around(mesh.points);
  const Point3 middle = 0.5 * (box.low + box.high);
  // [node] Distance to the nearest chosen or clamped node; at the start, to the centre.
  std::vector<double> distance;
  for (const int node : nodes) {
    double nearest = clamps.empty() ? length(mesh.points[at(node)] - middle) : box.diagonal();
    for (const SolidClamp& clamp : clamps) {
      nearest = std::min(nearest, length(mesh.points[at(node)] - clamp.centre) - clamp.radius);
    }
    distance.push_back(nearest);
  }
  std::vector<int> taken;
  while (static_cast<int>(taken.size()) < count && taken.size() < nodes.size()) {
    const auto next = std::ranges::max_element(distance) - distance.begin();
    const int node = nodes[static_cast<std::size_t>(next)];
    const bool is_first = taken.empty() && clamps.empty();
    taken.push_back(node);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double to_it = length(mesh.points[at(nodes[i])] - mesh.points[at(node)]);
      distance[i] = is_first ? to_it : std::min(distance[i], to_it);
    }
  }
  return taken;
}

double shape_at(const SolidModes& modes, const SolidPlace& place, std::size_t mode) {
  double sum = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sum += place.direction[axis] * modes.shapes(3 * at(place.node) + axis, mode);
  }
  return sum;
}

}  // namespace ressort::solids
