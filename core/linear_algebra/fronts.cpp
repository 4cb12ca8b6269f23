#include "core/linear_algebra/fronts.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

namespace ressort::linear_algebra {
namespace {

constexpr std::size_t leaf_nodes = 24;  // Smaller sets of nodes are not dissected further.

using Dense = Eigen::MatrixXd;

std::size_t at(int index) {
  return static_cast<std::size_t>(index);
}
Eigen::Index eigen(std::size_t size) {
  return static_cast<Eigen::Index>(size);
}

}  // namespace

FrontalCholesky::FrontalCholesky(const SparseMatrix& pattern,
                                 std::span<const std::array<double, 3>> places,
                                 const Progress& progress)
    : neighbours_(places.size()),
      places_(places.begin(), places.end()),
      order_(places.size(), -1),
      side_(places.size(), 0) {
  for (int column = 0; column < pattern.size(); ++column) {
    for (int i = pattern.first[at(column)] + 1; i < pattern.first[at(column) + 1]; ++i) {
      neighbours_[at(column)].push_back(pattern.row[at(i)]);
      neighbours_[at(pattern.row[at(i)])].push_back(column);
    }
  }
  progress.spend(4 * pattern.row.size());
  std::vector<int> nodes(places.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i] = static_cast<int>(i);
  }
  dissect(nodes);
  find_borders(pattern);
  progress.spend(8 * pattern.row.size());
}

// Nested dissection: halves the nodes by a plane across their longest extent. The nodes of one half
// that touch the other form the separator, which is eliminated after both halves.
void FrontalCholesky::dissect(std::span<int> nodes) {
  std::size_t parted =
      0;  // Sizes of the three consecutive ranges: first half, second half, separator.
  std::size_t parting = 0;
  if (nodes.size() > leaf_nodes) {
    std::array<double, 3> low = places_[at(nodes[0])];
    std::array<double, 3> high = low;
    for (const int node : nodes) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], places_[at(node)][axis]);
        high[axis] = std::max(high[axis], places_[at(node)][axis]);
      }
    }
    std::size_t axis = 0;
    for (std::size_t other = 1; other < 3; ++other) {
      axis = high[other] - low[other] > high[axis] - low[axis] ? other : axis;
    }
    const std::size_t half = nodes.size() / 2;
    const auto before = [&](int a, int b) {
      return std::pair(places_[at(a)][axis], a) < std::pair(places_[at(b)][axis], b);
    };
    std::nth_element(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(half), nodes.end(),
                     before);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      side_[at(nodes[i])] = i < half ? 1 : 2;
    }
    const auto touches = [&](int node, char side) {
      return std::any_of(neighbours_[at(node)].begin(), neighbours_[at(node)].end(),
                         [&](int other) { return side_[at(other)] == side; });
    };
    std::size_t count[3] = {0, 0, 0};
    for (const int node : nodes) {
      const char side = side_[at(node)];
      count[at(side)] += touches(node, side == 1 ? 2 : 1) ? 1 : 0;
    }
    const char thinner = count[1] <= count[2] ? 1 : 2;
    for (const int node : nodes) {  // A marked node is adjacent to its own half only.
      if (side_[at(node)] == thinner && touches(node, thinner == 1 ? 2 : 1)) {
        side_[at(node)] = 3;
      }
    }
    std::sort(nodes.begin(), nodes.end(), [&](int a, int b) {
      return std::pair(side_[at(a)], a) < std::pair(side_[at(b)], b);
    });
    for (const int node : nodes) {
      parted += side_[at(node)] == 1 ? 1 : 0;
      parting += side_[at(node)] == 3 ? 1 : 0;
    }
    for (const int node : nodes) {
      side_[at(node)] = 0;
    }
  }
  const std::size_t rest = nodes.size() - parting;
  const bool is_leaf = parting == 0 && (parted == 0 || parted == rest);
  std::vector<int> children;
  if (!is_leaf) {
    for (const std::span<int> half : {nodes.first(parted), nodes.subspan(parted, rest - parted)}) {
      if (!half.empty()) {
        dissect(half);
        children.push_back(static_cast<int>(fronts_.size()) - 1);
      }
    }
  }
  const std::span<int> own = is_leaf ? nodes : nodes.last(parting);
  for (const int child : children) {
    fronts_[at(child)].parent = static_cast<int>(fronts_.size());
  }
  fronts_.push_back({.nodes = {own.begin(), own.end()}, .own = own.size()});
}

void FrontalCholesky::find_borders(const SparseMatrix& pattern) {
  int next = 0;
  std::vector<int> front_of(order_.size());
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    for (const int node : fronts_[f].nodes) {
      order_[at(node)] = next++;
      front_of[at(node)] = static_cast<int>(f);
    }
  }
  std::vector<int> seen(order_.size(), -1);
  std::vector<std::vector<std::size_t>> children(fronts_.size());
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    const int mark = static_cast<int>(f);
    if (fronts_[f].parent >= 0) {
      children[at(fronts_[f].parent)].push_back(f);
    }
    std::vector<int>& nodes = fronts_[f].nodes;
    for (const int node : nodes) {
      seen[at(node)] = mark;
    }
    const std::size_t own = nodes.size();
    const auto border = [&](int node) {
      if (front_of[at(node)] > mark && seen[at(node)] != mark) {
        seen[at(node)] = mark;
        nodes.push_back(node);
      }
    };
    for (std::size_t i = 0; i < own; ++i) {
      for (const int node : neighbours_[at(nodes[i])]) {
        border(node);
      }
    }
    for (const std::size_t child : children[f]) {
      for (std::size_t i = fronts_[child].own; i < fronts_[child].nodes.size(); ++i) {
        border(fronts_[child].nodes[i]);
      }
    }
    std::sort(nodes.begin() + static_cast<std::ptrdiff_t>(own), nodes.end(),
              [&](int a, int b) { return order_[at(a)] < order_[at(b)]; });
    size_ += 9.0 * static_cast<double>(nodes.size()) * static_cast<double>(own);
  }
  for (int column = 0; column < pattern.size(); ++column) {
    for (int i = pattern.first[at(column)]; i < pattern.first[at(column) + 1]; ++i) {
      const int front = std::min(front_of[at(column)], front_of[at(pattern.row[at(i)])]);
      fronts_[at(front)].elements.push_back(i);
    }
  }
}

bool FrontalCholesky::factor(const SparseMatrix& pattern, std::span<const NodeBlock> blocks,
                             const Progress& progress) {
  std::vector<int> column_of(pattern.row.size());
  for (int column = 0; column < pattern.size(); ++column) {
    for (int i = pattern.first[at(column)]; i < pattern.first[at(column) + 1]; ++i) {
      column_of[at(i)] = column;
    }
  }
  // [front] The Schur complement that its own nodes leave for its border.
  std::vector<Dense> left(fronts_.size());
  std::vector<std::vector<std::size_t>> children(fronts_.size());
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    if (fronts_[f].parent >= 0) {
      children[at(fronts_[f].parent)].push_back(f);
    }
  }
  std::vector<int> place(order_.size());  // [node] Its row in the current front.
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    Front& front = fronts_[f];
    const Eigen::Index all = eigen(3 * front.nodes.size());
    const Eigen::Index own = eigen(3 * front.own);
    for (std::size_t i = 0; i < front.nodes.size(); ++i) {
      place[at(front.nodes[i])] = static_cast<int>(3 * i);
    }
    front.values.assign(3 * front.nodes.size() * 3 * front.own, 0.0);
    Eigen::Map<Dense> mine(front.values.data(), all, own);  // Only the lower triangle is used.
    Dense rest = Dense::Zero(all - own, all - own);
    const auto add = [&](int row, int column, double value) {
      if (row < column) {
        std::swap(row, column);
      }
      if (column < own) {
        mine(row, column) += value;
      } else {
        rest(row - own, column - own) += value;
      }
    };
    for (const int element : front.elements) {
      const int row = place[at(pattern.row[at(element)])];
      const int column = place[at(column_of[at(element)])];
      for (int b = 0; b < 3; ++b) {
        for (int a = row == column ? b : 0; a < 3; ++a) {
          add(row + a, column + b, blocks[at(element)][at(a + 3 * b)]);
        }
      }
    }
    for (const std::size_t child : children[f]) {
      Dense& given = left[child];
      const std::span<const int> border =
          std::span(fronts_[child].nodes).subspan(fronts_[child].own);
      for (std::size_t c = 0; c < border.size(); ++c) {  // Both are in elimination order.
        for (int b = 0; b < 3; ++b) {
          const int column = place[at(border[c])] + b;
          double* to = column < own ? &mine(0, column) : nullptr;
          for (std::size_t r = c; r < border.size(); ++r) {
            const int row = place[at(border[r])];
            const double* from = &given(eigen(3 * r), eigen(3 * c) + b);
            for (int a = 0; a < 3; ++a) {
              if (to != nullptr) {
                to[row + a] += from[a];
              } else {
                rest(row + a - own, column - own) += from[a];
              }
            }
          }
        }
      }
      given.resize(0, 0);
    }
    if (own > 0) {  // Empty for a separator of two halves that do not touch.
      Eigen::Ref<Dense> corner = mine.topRows(own);
      const Eigen::LLT<Eigen::Ref<Dense>> llt(corner);  // Factors in place.
      if (llt.info() != Eigen::Success) {
        return false;
      }
      if (all > own) {
        auto below = mine.bottomRows(all - own);
        corner.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
        rest.selfadjointView<Eigen::Lower>().rankUpdate(below, -1.0);
      }
    }
    left[f] = std::move(rest);
    progress.spend(static_cast<std::size_t>(all * all) * static_cast<std::size_t>(own) / 32 + 1);
  }
  return true;
}

void FrontalCholesky::solve(Matrix& columns) const {
  const Eigen::Index count = eigen(columns.columns());
  const auto rows = eigen(columns.rows());
  Eigen::Map<Dense> x(std::begin(columns.values), rows, count);
  // Rows of the current front: its own nodes, then its border.
  Dense part;
  const auto gather = [&](const Front& front) {
    part.resize(eigen(3 * front.nodes.size()), count);
    for (std::size_t i = 0; i < front.nodes.size(); ++i) {
      part.middleRows(eigen(3 * i), 3) = x.middleRows(3 * Eigen::Index{front.nodes[i]}, 3);
    }
  };
  const auto scatter = [&](const Front& front, std::size_t end) {
    for (std::size_t i = 0; i < end; ++i) {
      x.middleRows(3 * Eigen::Index{front.nodes[i]}, 3) = part.middleRows(eigen(3 * i), 3);
    }
  };
  for (const Front& front : fronts_) {
    const Eigen::Index all = eigen(3 * front.nodes.size());
    const Eigen::Index own = eigen(3 * front.own);
    if (own == 0) {
      continue;
    }
    const Eigen::Map<const Dense> l(front.values.data(), all, own);
    gather(front);
    auto mine = part.topRows(own);
    l.topRows(own).triangularView<Eigen::Lower>().solveInPlace(mine);
    part.bottomRows(all - own).noalias() -= l.bottomRows(all - own) * mine;
    scatter(front, front.nodes.size());
  }
  for (auto front = fronts_.rbegin(); front != fronts_.rend(); ++front) {
    const Eigen::Index all = eigen(3 * front->nodes.size());
    const Eigen::Index own = eigen(3 * front->own);
    if (own == 0) {
      continue;
    }
    const Eigen::Map<const Dense> l(front->values.data(), all, own);
    gather(*front);
    auto mine = part.topRows(own);
    mine.noalias() -= l.bottomRows(all - own).transpose() * part.bottomRows(all - own);
    l.topRows(own).triangularView<Eigen::Lower>().transpose().solveInPlace(mine);
    scatter(*front, front->own);
  }
}

}  // namespace ressort::linear_algebra
