#include "core/compile/chains_form.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace ressort {
namespace {

constexpr std::uint32_t none = 0xffffffffu;

class ChainFinder {
 public:
  explicit ChainFinder(const Program& program)
      : program_(program),
        mass_run_(program.position.size(), none),
        can_hold_(program.position.size(), true),
        near_(program.position.size()),
        is_chained_(program.moving, false),
        is_used_(program.ends.size(), false) {
    for (std::uint32_t run = 0; run < program.mass_runs.size(); ++run) {
      const MassRun& masses = program.mass_runs[run];
      std::fill_n(mass_run_.begin() + masses.first, masses.count, run);
      std::fill_n(can_hold_.begin() + masses.first, masses.count, false);
    }
    for (const TapSlot& tap : program.taps) {
      can_hold_[tap.node] = false;  // what acts on it does not end there
    }
  }

  std::optional<Chains> find() {
    std::vector<std::uint32_t> order(program_.link_runs.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return program_.link_runs[a].count > program_.link_runs[b].count;
    });
    for (const std::uint32_t run : order) {
      if (program_.link_runs[run].law == Law::spring &&
          program_.link_runs[run].count + 1 >= least_chain_masses) {
        search(program_.link_runs[run]);
      }
    }
    if (form_.chains.empty()) {
      return std::nullopt;
    }
    for (std::uint32_t node = 0; node < program_.moving; ++node) {
      if (!is_chained_[node]) {
        form_.loose.push_back(node);
      }
    }
    for (std::uint32_t link = 0; link < program_.ends.size(); ++link) {
      if (!is_used_[link]) {
        form_.links.push_back(link);
      }
    }
    return std::move(form_);
  }

 private:
  // What one run of springs ties a node to.
  struct Near {
    std::uint32_t degree = 0;
    std::array<std::uint32_t, 2> springs{none, none};  // that may be a chain's
    std::uint32_t holder = none;                       // a spring to what does not move
    bool is_seen = false;
  };

  bool is_equal(const Ends& ends) const {
    const auto [a, b] = ends;
    return a != b && mass_run_[a] != none && mass_run_[a] == mass_run_[b] && !is_chained_[a] &&
           !is_chained_[b];
  }

  void search(const LinkRun& run) {
    const auto each_spring = [&](auto&& use) {
      for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
        use(link, program_.ends[link]);
      }
    };
    each_spring([&](std::uint32_t, const Ends& ends) { near_[ends.a] = near_[ends.b] = {}; });
    each_spring([&](std::uint32_t link, const Ends& ends) {
      if (is_equal(ends)) {
        ++near_[ends.a].degree;
        ++near_[ends.b].degree;
      } else if (can_hold_[ends.a] != can_hold_[ends.b]) {
        near_[can_hold_[ends.a] ? ends.b : ends.a].holder = link;
      }
    });
    each_spring([&](std::uint32_t link, const Ends& ends) {
      Near& a = near_[ends.a];
      Near& b = near_[ends.b];
      if (is_equal(ends) && a.degree <= 2 && b.degree <= 2) {
        a.springs[a.springs[0] == none ? 0 : 1] = link;
        b.springs[b.springs[0] == none ? 0 : 1] = link;
      }
    });
    // From their ends; what is left then are rings, that may be cut anywhere.
    const std::size_t before = form_.nodes.size();
    for (const bool from_end : {true, false}) {
      each_spring([&](std::uint32_t, const Ends& ends) {
        for (const std::uint32_t node : {ends.a, ends.b}) {
          const Near& near = near_[node];
          if (!near.is_seen && near.springs[0] != none && (near.springs[1] == none) == from_end) {
            add_chain(run, node);
          }
        }
      });
    }
    for (std::size_t i = before; i < form_.nodes.size(); ++i) {
      is_chained_[form_.nodes[i]] = true;
    }
  }

  void add_chain(const LinkRun& run, std::uint32_t node) {
    Chain chain{.first = static_cast<std::uint32_t>(form_.nodes.size()),
                .mass_run = mass_run_[node],
                .stiffness = run.coefficients[0],
                .damping = run.coefficients[1]};
    std::vector<std::uint32_t> springs;
    while (node != none) {
      near_[node].is_seen = true;
      form_.nodes.push_back(node);
      std::uint32_t next = none;
      for (const std::uint32_t spring : near_[node].springs) {
        if (next == none && spring != none && !near_[other(spring, node)].is_seen) {
          springs.push_back(spring);
          next = other(spring, node);
        }
      }
      node = next;
    }
    chain.count = static_cast<std::uint32_t>(form_.nodes.size()) - chain.first;
    if (chain.count < least_chain_masses) {
      form_.nodes.resize(chain.first);
      return;
    }
    for (const std::uint32_t spring : springs) {
      is_used_[spring] = true;
    }
    chain.left = held_by(form_.nodes[chain.first]);
    chain.right = held_by(form_.nodes.back());
    form_.chains.push_back(chain);
  }

  // What holds a chain's end, by a spring that is then used.
  std::uint32_t held_by(std::uint32_t node) {
    const std::uint32_t spring = near_[node].holder;
    if (spring == none) {
      return Chain::free;
    }
    is_used_[spring] = true;
    return other(spring, node);
  }

  std::uint32_t other(std::uint32_t link, std::uint32_t node) const {
    const Ends& ends = program_.ends[link];
    return ends.a == node ? ends.b : ends.a;
  }

  const Program& program_;
  std::vector<std::uint32_t> mass_run_;  // [node], none: it does not move
  std::vector<bool> can_hold_;           // [node] grounds and position inputs
  std::vector<Near> near_;               // [node]
  std::vector<bool> is_chained_;         // [moving node]
  std::vector<bool> is_used_;            // [link]
  Chains form_;
};

}  // namespace

std::optional<Chains> chains_form(const Program& program) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  if (!program.taps.empty() &&
      std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
    return std::nullopt;  // what a point does to a node is never summed
  }
  return ChainFinder(program).find();
}

}  // namespace ressort
