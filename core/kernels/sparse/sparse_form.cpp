#include "core/kernels/sparse/sparse_form.h"

#include <algorithm>
#include <map>

namespace ressort {
namespace {

class SparseMaker {
 public:
  explicit SparseMaker(const Program& program) : program_(program) {}

  Sparse make() {
    walk();
    share_links();
    sort_masses();
    return std::move(form_);
  }

 private:
  bool moves(std::uint32_t node) const { return node < program_.moving; }

  // From neighbour to neighbour: what is linked is not far apart in memory then.
  void walk() {
    std::vector<std::vector<std::uint32_t>> neighbours(program_.moving);
    for (const auto& [a, b] : program_.ends) {
      if (moves(a) && moves(b)) {
        neighbours[a].push_back(b);
        neighbours[b].push_back(a);
      }
    }
    std::vector<bool> is_seen(program_.moving);
    for (std::uint32_t start = 0; start < program_.moving; ++start) {
      std::size_t next = form_.order.size();
      if (!is_seen[start]) {
        is_seen[start] = true;
        form_.order.push_back(start);
      }
      for (; next < form_.order.size(); ++next) {
        for (const std::uint32_t node : neighbours[form_.order[next]]) {
          if (!is_seen[node]) {
            is_seen[node] = true;
            form_.order.push_back(node);
          }
        }
      }
    }
  }

  void share_links() {
    looked_up_.resize(program_.moving);
    choose_springs();
    std::map<Law, std::vector<std::uint32_t>> runs;
    for (std::uint32_t i = 0; i < program_.link_runs.size(); ++i) {
      if (i != form_.springs) {
        runs[program_.link_runs[i].law].push_back(i);
      }
    }
    for (const auto& [law, same] : runs) {
      own_links(same);
    }
  }

  void choose_springs() {
    for (std::uint32_t i = 0; i < program_.link_runs.size(); ++i) {
      const LinkRun& run = program_.link_runs[i];
      if (run.law != Law::spring || run.count < program_.moving / 2 ||
          run.count < program_.ends.size() / 2) {
        continue;
      }
      form_.springs = i;
      for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
        look_up(program_.ends[link].a);
        look_up(program_.ends[link].b);
      }
      return;
    }
  }

  // Every mass as many as it can be: rows of lanes are full where neighbours own alike.
  void own_links(const std::vector<std::uint32_t>& runs) {
    std::vector<std::uint32_t> owned(program_.moving);
    std::vector<SparseLink> links;
    for (const std::uint32_t run : runs) {
      const LinkRun& same = program_.link_runs[run];
      for (std::uint32_t link = same.first; link < same.first + same.count; ++link) {
        const auto [a, b] = program_.ends[link];
        if (!moves(a) && !moves(b)) {
          continue;
        }
        const bool is_reversed = !moves(a) || (moves(b) && owned[b] < owned[a]);
        ++owned[is_reversed ? b : a];
        look_up(is_reversed ? a : b);
        links.push_back({run, link, is_reversed});
      }
    }
    if (!links.empty()) {
      owned_.push_back(std::move(owned));
      form_.rest.push_back(std::move(links));
    }
  }

  void look_up(std::uint32_t node) {
    if (moves(node)) {
      ++looked_up_[node];
    }
  }

  void sort_masses() {
    std::stable_sort(form_.order.begin(), form_.order.end(), [&](std::uint32_t m, std::uint32_t n) {
      for (const auto& owned : owned_) {
        if (owned[m] != owned[n]) {
          return owned[m] > owned[n];
        }
      }
      return looked_up_[m] > looked_up_[n];
    });
  }

  const Program& program_;
  Sparse form_;
  std::vector<std::vector<std::uint32_t>> owned_;  // [law that occurs][mass] links
  std::vector<std::uint32_t> looked_up_;           // [mass] numbers
};

// Nobody computes a link between two that stand, unless it is one of the springs.
bool hears_such(const Program& program, const Sparse& form) {
  const auto stands = [&](std::uint32_t node) { return node >= program.moving; };
  if (std::none_of(program.outputs.begin(), program.outputs.end(), [&](const OutputSlot& output) {
        return output.is_force && stands(output.node);
      })) {
    return false;
  }
  for (std::uint32_t i = 0; i < program.link_runs.size(); ++i) {
    const LinkRun& run = program.link_runs[i];
    const auto first = program.ends.begin() + run.first;
    if (i != form.springs && std::any_of(first, first + run.count, [&](const Ends& ends) {
          return stands(ends.a) && stands(ends.b);
        })) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::optional<Sparse> sparse_form(const Program& program, const Progress& progress) {
  if (!is_plain(program) || program.moving < least_sparse_masses || !program.taps.empty()) {
    return std::nullopt;
  }
  progress.spend(8 * program.ends.size());
  Sparse form = SparseMaker(program).make();
  return hears_such(program, form) ? std::nullopt : std::optional(std::move(form));
}

}  // namespace ressort
