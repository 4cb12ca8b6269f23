#include "core/compile/reduce.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::compile {
namespace {

constexpr std::size_t most_sum_steps = 64;  // largest formula that is the sum of two

// A spring and a parallel one, which adds its stiffness and damping to the first.
struct ParallelPair {
  std::uint32_t kept = 0;
  std::uint32_t merged = 0;
};

// Finds parallel springs in one pass over the links, sorted by their lower end. O(links)
std::vector<ParallelPair> find_parallel_springs(const Network& network) {
  constexpr std::uint32_t none = 0xffffffffu;
  const std::vector<Link>& links = network.links;
  const auto lower = [](const Link& link) { return std::min(link.a, link.b); };
  std::vector<std::uint32_t> first(network.masses.size() + 1, 0);  // [lower end] in `order`
  for (const Link& link : links) {
    ++first[lower(link) + 1];
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> order(links.size());
  std::vector<std::uint32_t> next = first;
  for (std::uint32_t l = 0; l < links.size(); ++l) {
    order[next[lower(links[l])]++] = l;
  }
  std::vector<ParallelPair> pairs;
  std::vector<std::uint32_t> latest(network.masses.size(), none);  // [upper end] spring
  for (const std::uint32_t l : order) {
    const Link& link = links[l];
    if (!is_linear(link.law) || link.a == link.b) {
      continue;
    }
    std::uint32_t& other = latest[std::max(link.a, link.b)];
    if (other == none || lower(links[other]) != lower(link)) {
      other = l;
    } else {
      pairs.push_back({other, l});
    }
  }
  return pairs;
}

// Appends formulas to a network, each constant and each sum of two formulas once.
class FormulaMaker {
 public:
  explicit FormulaMaker(Network& network) : network_(network) {}

  ArgumentId zero() {
    if (!zero_) {
      zero_ = network_.add(0.0);
    }
    return *zero_;
  }

  // Returns nothing if the formula would be too long.
  std::optional<ArgumentId> sum(ArgumentId left, ArgumentId right) {
    if (left == no_argument || right == no_argument) {
      return left == no_argument ? right : left;
    }
    const auto [entry, is_new] = sums_.try_emplace({left, right});
    if (is_new) {
      Formula formula = network_.arguments[left];
      const Formula& second = network_.arguments[right];
      if (formula.size() + second.size() < most_sum_steps) {
        formula.insert(formula.end(), second.begin(), second.end());
        formula.push_back({Op::add, 0, 0.0});
        entry->second = network_.add(std::move(formula));
      }
    }
    return entry->second;
  }

 private:
  Network& network_;
  std::optional<ArgumentId> zero_;
  std::map<std::pair<ArgumentId, ArgumentId>, std::optional<ArgumentId>> sums_;
};

}  // namespace

Reduced merge_parallel_springs(Network network, const Progress& progress) {
  const std::vector<ParallelPair> pairs = find_parallel_springs(network);
  const std::vector<double> values = parameter_values(network);
  FormulaMaker formulas(network);
  std::size_t count = 0;
  for (const auto& [kept, merged] : pairs) {
    progress.spend(20);
    Link& both = network.links[kept];
    Link& other = network.links[merged];
    const auto k = formulas.sum(both.arguments[0], other.arguments[0]);
    const auto z = formulas.sum(both.arguments[1], other.arguments[1]);
    if (!k || !z) {
      continue;
    }
    const auto stiffness = [&](const Link& link) {
      return argument_value(network, link.arguments[0], values);
    };
    // Messages name the stiffer of the two.
    if (stiffness(other) > stiffness(both)) {
      both.name = other.name;
      both.location = other.location;
    }
    both.arguments = {*k, *z, no_argument, no_argument, no_argument};
    const ArgumentId zero = formulas.zero();
    other.arguments = {zero, zero, no_argument, no_argument, no_argument};
    other.b = other.a;
    ++count;
  }
  return {std::move(network), count};
}

Reduced reduce(const CompileRequest& request) {
  const CompileOptions& options = request.options;
  Network whole = expand_macros(request.written, options.progress);
  options.progress.spend(8 * whole.links.size());
  const bool may_merge = !options.bare || request.budget != Budget{};
  return may_merge ? merge_parallel_springs(std::move(whole), options.progress)
                   : Reduced{std::move(whole)};
}

}  // namespace ressort::compile
