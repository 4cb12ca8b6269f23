#include "core/analysis/modes/layout.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/linear_algebra/cholesky.h"
#include "core/linear_algebra/eigen.h"
#include "core/linear_algebra/matrix.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

constexpr int most_spread = 20'000;  // Largest network that is laid out by its links.
constexpr int vectors = 6;           // Number of eigenvectors examined.

// Returns the part of a unit vector that is not a quadratic function of another unit vector. The
// second eigenvector of a long string is such a parabola, and does not span the plane.
double apart(const Vector& vector, const Vector& along) {
  const Vector one(1.0 / std::sqrt(static_cast<double>(along.size())), along.size());
  Vector square = along * along;
  square -= dot(square, one) * one;
  square -= dot(square, along) * along;
  const double length = std::sqrt(dot(square, square));
  const double share = length > 0.0 ? dot(vector, square) / length : 0.0;
  return 1.0 - share * share;
}

class LayoutMaker {
 public:
  explicit LayoutMaker(const Network& network) : network_(network) {}

  MassLayout make() {
    MassLayout layout;
    std::vector<LayoutPoint> loose;
    bool are_drawn = network_.macros.empty();
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      const Mass& mass = network_.masses[i];
      if (mass.kind == MassKind::point || mass.kind == MassKind::position) {
        continue;
      }
      are_drawn = are_drawn && mass.drawing > 0;
      loose.push_back({.x = static_cast<double>(loose.size()), .mass = i});
    }
    layout.is_plane = std::ranges::any_of(network_.macros,
                                          [](const Macro& macro) { return is_mesh(macro.kind); });
    if (are_drawn && !loose.empty()) {
      layout.is_plane = true;
      for (LayoutPoint& point : loose) {
        const Drawing& drawing = network_.drawings[network_.masses[point.mass].drawing - 1];
        point.x = drawing.x;
        point.y = drawing.y;
      }
    } else if (network_.macros.empty()) {
      layout.is_plane = spread(loose);
    }
    double top = 0.0;
    if (!loose.empty()) {
      layout.rows.push_back(std::move(loose));
      top = 2.0;
    }
    auto first = static_cast<std::uint32_t>(network_.masses.size());
    for (const Macro& macro : network_.macros) {
      layout.tops.push_back(top);
      if (is_waveguide(macro.kind)) {
        top += 2.0;
        continue;
      }
      std::vector<LayoutPoint>& row = layout.rows.emplace_back();
      for (std::uint32_t i = 0; i < macro.length; ++i) {
        for (std::uint32_t j = 0; j < macro.width; ++j) {
          row.push_back(
              {static_cast<double>(i), top + static_cast<double>(j), first + i * macro.width + j});
        }
      }
      first += static_cast<std::uint32_t>(node_count(macro));
      top += static_cast<double>(macro.width) + 1.0;
    }
    return layout;
  }

 private:
  // Lays out the points and returns whether they span the plane; a chain is put in order.
  bool spread(std::vector<LayoutPoint>& points) const {
    const auto size = static_cast<int>(points.size());
    if (size < 3 || size > most_spread) {
      return false;
    }
    std::vector<int> row(network_.masses.size(), -1);
    for (int i = 0; i < size; ++i) {
      row[points[static_cast<std::size_t>(i)].mass] = i;
    }
    std::vector<double> degree(points.size(), 0.0);
    std::vector<SparseMatrix::Element> elements;
    for (const Link& link : network_.links) {
      const int a = row[link.a];
      const int b = row[link.b];
      if (a >= 0 && b >= 0 && a != b) {
        elements.push_back({std::max(a, b), std::min(a, b), -1.0});
        degree[static_cast<std::size_t>(a)] += 1.0;
        degree[static_cast<std::size_t>(b)] += 1.0;
      }
    }
    const bool is_chain = *std::ranges::max_element(degree) <= 2.0;
    for (int i = 0; i < size; ++i) {
      elements.push_back({i, i, degree[static_cast<std::size_t>(i)]});
    }
    const auto pairs = lowest({size, elements});
    constexpr double joined = 1e-9;
    if (!pairs || pairs->values[1] < joined) {
      return false;  // Several unconnected components.
    }
    const Vector along = pairs->vectors.column(1);
    if (is_chain) {
      std::ranges::sort(points, [&](const LayoutPoint& a, const LayoutPoint& b) {
        return along[static_cast<std::size_t>(row[a.mass])] <
               along[static_cast<std::size_t>(row[b.mass])];
      });
      for (std::size_t i = 0; i < points.size(); ++i) {
        points[i].x = static_cast<double>(i);
      }
      return false;
    }
    std::size_t across = 2;
    while (across + 1 < pairs->values.size() && apart(pairs->vectors.column(across), along) < 0.5) {
      ++across;
    }
    const Vector beside = pairs->vectors.column(across);
    const double scale = std::sqrt(pairs->values[1] / pairs->values[across]);
    const double unit = std::sqrt(static_cast<double>(size));
    for (LayoutPoint& point : points) {
      const auto at = static_cast<std::size_t>(row[point.mass]);
      // The eigenvectors of a mesh are cosines; the arcsine makes the distances equal.
      point.x = unit * std::asin(along[at] / largest(along));
      point.y = unit * scale * std::asin(beside[at] / largest(beside));
    }
    return true;
  }

  static std::optional<Eigenpairs> lowest(SparseMatrix laplacian) {
    constexpr double shift = -1e-3;
    const auto size = static_cast<std::size_t>(laplacian.size());
    for (std::size_t k = 0; k < size; ++k) {
      laplacian.value[static_cast<std::size_t>(laplacian.first[k])] -= shift;
    }
    Cholesky factor;
    if (!factor.analyze(laplacian, {}) || !factor.factor(laplacian, {})) {
      return std::nullopt;
    }
    const int count = std::min(vectors, laplacian.size() - 1);
    return eigenpairs_near(shift, count, laplacian.size(), [&](const double* from, double* to) {
      std::copy_n(from, size, to);
      factor.solve(to);
    });
  }

  const Network& network_;
};

}  // namespace

MassLayout layout_of(const Network& network) {
  return LayoutMaker(network).make();
}

}  // namespace ressort::analysis
