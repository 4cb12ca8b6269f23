#include "core/compile/merge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "core/laws/laws.h"

namespace ressort::compile {
namespace {

constexpr std::uint32_t nobody = 0xffffffffu;
constexpr double least_ratio = 1e-12;  // below which two z/k are the same

double cents_of(double mass_ratio) {
  return 600.0 * std::log2(1.0 + mass_ratio);
}

class Merger {
 public:
  Merger(const Network& network, const Budget& budget, const Progress& progress)
      : source_(network), values_(parameter_values(network)), progress_(progress) {
    allowed_cents_ = budget.cents < Budget::unlimited ? budget.cents : 0.0;
  }

  std::optional<Merged> merge() {
    merge_parallel();
    count_links();
    mark_used();
    for (std::uint32_t mass = 0; mass < source_.masses.size(); ++mass) {
      progress_.spend(2);
      try_series(mass);
    }
    return std::move(merged_);
  }

 private:
  const Network& now() const { return merged_ ? merged_->network : source_; }
  Merged& edit() {  // a copy, once there is something to merge
    if (!merged_) {
      merged_.emplace(Merged{.network = source_});
    }
    return *merged_;
  }

  ArgumentId add(Formula formula) {
    edit().network.arguments.push_back(std::move(formula));
    return static_cast<ArgumentId>(now().arguments.size() - 1);
  }
  ArgumentId number(double value) { return add({{Op::number, 0, value}}); }
  ArgumentId zero() {
    if (!zero_) {
      zero_ = number(0.0);
    }
    return *zero_;
  }

  std::optional<double> constant(ArgumentId argument) {
    if (argument == no_argument) {
      return 0.0;
    }
    const Formula& formula = now().arguments[argument];
    return is_constant(formula) ? std::optional(evaluate(formula, {})) : std::nullopt;
  }

  // Both formulas on the stack, and their sum; nothing where that would be too long.
  std::optional<ArgumentId> sum(ArgumentId left, ArgumentId right) {
    if (left == no_argument || right == no_argument) {
      return left == no_argument ? right : left;
    }
    const auto [entry, is_new] = sums_.try_emplace({left, right});
    if (is_new) {
      Formula formula = now().arguments[left];
      const Formula& second = now().arguments[right];
      if (formula.size() + second.size() < max_sum_steps) {
        formula.insert(formula.end(), second.begin(), second.end());
        formula.push_back({Op::add, 0, 0.0});
        entry->second = add(std::move(formula));
      }
    }
    return entry->second;
  }

  void silence(std::uint32_t link) {
    const ArgumentId nothing = zero();
    Link& gone = edit().network.links[link];
    gone.arguments = {nothing, nothing, no_argument, no_argument, no_argument};
    gone.b = gone.a;
  }

  void merge_parallel() {
    // By the lower of their ends, in the order in which they are written.
    std::vector<std::uint32_t> first(source_.masses.size() + 1, 0);
    const auto lower = [](const Link& link) { return std::min(link.a, link.b); };
    for (const Link& link : source_.links) {
      ++first[lower(link) + 1];
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<std::uint32_t> order(source_.links.size());
    std::vector<std::uint32_t> next = first;
    for (std::uint32_t l = 0; l < source_.links.size(); ++l) {
      order[next[lower(source_.links[l])]++] = l;
    }
    // The last link seen from the present lower end to each other one.
    std::vector<std::uint32_t> seen(source_.masses.size(), nobody);
    for (std::uint32_t mass = 0; mass < source_.masses.size(); ++mass) {
      for (std::uint32_t i = first[mass]; i < first[mass + 1]; ++i) {
        const Link& link = source_.links[order[i]];
        if (link.law != Law::spring || link.a == link.b) {
          continue;
        }
        std::uint32_t& other = seen[std::max(link.a, link.b)];
        if (other == nobody || lower(source_.links[other]) != mass) {
          other = order[i];
        } else {
          take_over(other, order[i]);
        }
      }
    }
  }

  void take_over(std::uint32_t stays, std::uint32_t goes) {
    progress_.spend(20);
    const auto k = sum(now().links[stays].arguments[0], now().links[goes].arguments[0]);
    const auto z = sum(now().links[stays].arguments[1], now().links[goes].arguments[1]);
    if (k && z) {
      Link& both = edit().network.links[stays];
      const Link& other = source_.links[goes];
      // Whoever is told of both knows them by the stiffer.
      if (stiffness(other) > stiffness(both)) {
        both.name = other.name;
        both.location = other.location;
      }
      both.arguments = {*k, *z, no_argument, no_argument, no_argument};
      silence(goes);
      ++edit().parallel;
    }
  }

  double stiffness(const Link& link) const {
    return argument_value(now(), link.arguments[0], values_);
  }

  bool is_silent(const Link& link) const {
    return zero_ && link.law == Law::spring && link.arguments[0] == *zero_ &&
           link.arguments[1] == *zero_;
  }

  void count_links() {
    links_of_.assign(now().masses.size(), {});
    for (std::uint32_t l = 0; l < now().links.size(); ++l) {
      const Link& link = now().links[l];
      if (!is_silent(link)) {
        for (const std::uint32_t end : {link.a, link.b}) {
          auto& [count, links] = links_of_[end];
          if (count < 2) {
            links[count] = l;
          }
          ++count;
        }
      }
    }
  }

  void mark_used() {
    is_used_.assign(now().masses.size(), false);
    burden_.assign(now().masses.size(), 0.0);
    for (const Input& input : now().inputs) {
      is_used_[input.mass] = true;
    }
    for (const Output& output : now().outputs) {
      is_used_[output.mass] = true;
    }
    std::vector<bool> is_marked(now().masses.size(), false);  // [first node] of a macro
    for (const Tap& tap : now().taps) {
      progress_.spend(1);
      if (!is_marked[tap.first]) {
        const std::size_t nodes = std::size_t{tap.length} * tap.width;
        progress_.spend(nodes);
        std::fill_n(is_used_.begin() + tap.first, nodes, true);
        is_marked[tap.first] = true;
      }
    }
  }

  struct Spring {
    std::uint32_t link;
    std::uint32_t end;  // the far one
    double k;
    double z;
  };
  std::optional<Spring> spring_at(std::uint32_t mass, std::uint32_t l) {
    const Link& link = now().links[l];
    const auto k = constant(link.arguments[0]);
    const auto z = constant(link.arguments[1]);
    if (link.law != Law::spring || !k || !z || !(*k > 0.0) || !(*z >= 0.0)) {
      return std::nullopt;
    }
    return Spring{l, link.a == mass ? link.b : link.a, *k, *z};
  }

  // What a light mass adds to the relative mass of its neighbours, those of before included;
  // nothing where a neighbour's mass is not known.
  std::optional<double> burden(const Spring& spring, double added) {
    const Mass& end = now().masses[spring.end];
    if (end.kind == MassKind::ground || end.kind == MassKind::position) {
      return 0.0;  // no partial of its own
    }
    const auto mass = moves(end) ? constant(end.mass) : std::nullopt;
    return mass && *mass > 0.0 ? std::optional(burden_[spring.end] + added / *mass) : std::nullopt;
  }

  void try_series(std::uint32_t i) {
    const Mass& mass = now().masses[i];
    const auto m = constant(mass.mass);
    if (mass.kind != MassKind::mass || mass.gravity != no_argument || is_used_[i] ||
        mass.position != 0.0 || mass.third != 0.0 || !m || !(*m > 0.0) || links_of_[i].first != 2) {
      return;
    }
    const auto left = spring_at(i, links_of_[i].second[0]);
    const auto right = spring_at(i, links_of_[i].second[1]);
    if (!left || !right || left->end == right->end || left->end == i || right->end == i ||
        std::fabs(left->z * right->k - right->z * left->k) > least_ratio * left->k * right->k) {
      return;
    }
    const double k = left->k + right->k;
    const bool is_forced = k + 2.0 * (left->z + right->z) > 4.0 * *m;
    const auto at_left = burden(*left, *m * left->k / k);
    const auto at_right = burden(*right, *m * right->k / k);
    if (!at_left || !at_right) {
      return;
    }
    const double cents = cents_of(std::max(*at_left, *at_right));
    if (cents <= std::max(allowed_cents_, is_forced ? forced_cents : 0.0)) {
      become_spring(i, *left, *right);
      burden_[left->end] = *at_left;
      burden_[right->end] = *at_right;
      edit().cents = std::max(edit().cents, cents);
    }
  }

  void become_spring(std::uint32_t mass, const Spring& left, const Spring& right) {
    const double share = right.k / (left.k + right.k);
    const ArgumentId k = number(left.k * share);
    const ArgumentId z = number(left.z * share);
    Link& link = edit().network.links[left.link];
    link.a = left.end;
    link.b = right.end;
    link.arguments = {k, z, no_argument, no_argument, no_argument};
    silence(right.link);
    Mass& ground = edit().network.masses[mass];
    ground.kind = MassKind::ground;
    ground.mass = no_argument;
    for (std::uint32_t& l : links_of_[right.end].second) {
      l = l == right.link ? left.link : l;
    }
    ++edit().series;
  }

  static constexpr std::size_t max_sum_steps = 64;

  const Network& source_;
  std::vector<double> values_;  // [parameter] as the text declares them
  const Progress& progress_;
  std::optional<Merged> merged_;
  double allowed_cents_ = 0.0;
  std::optional<ArgumentId> zero_;
  std::map<std::pair<ArgumentId, ArgumentId>, std::optional<ArgumentId>> sums_;
  // [mass] how many links, and the first two
  std::vector<std::pair<std::size_t, std::array<std::uint32_t, 2>>> links_of_;
  std::vector<bool> is_used_;   // [mass] by an input, an output or a place
  std::vector<double> burden_;  // [mass] by how much of itself merged ones have made it lighter
};

}  // namespace

std::optional<Merged> merge(const Network& network, const Budget& budget,
                            const Progress& progress) {
  return Merger(network, budget, progress).merge();
}

std::string describe(const Merged& merged) {
  std::string text;
  if (merged.parallel > 0) {
    text = std::to_string(merged.parallel) +
           (merged.parallel == 1 ? " spring beside another" : " springs beside others");
  }
  if (merged.series > 0) {
    char cents[32];
    std::snprintf(cents, sizeof cents, "%.2g", merged.cents);
    text += (text.empty() ? "" : ", ") + std::to_string(merged.series) +
            (merged.series == 1 ? " light mass" : " light masses") + " between springs (" + cents +
            " cents at most)";
  }
  return text;
}

}  // namespace ressort::compile
