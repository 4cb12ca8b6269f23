#include "core/kernels/chains/chains.h"

#include <algorithm>

#include "core/kernels/chains/chains_form.h"

namespace ressort::kernels {
namespace {

// Assigns places to nodes and translates the tables from nodes to places.
class TablesMaker {
 public:
  TablesMaker(const Program& program, const Chains& form, FoldedBy by)
      : program_(program),
        form_(form),
        lanes_(static_cast<std::uint32_t>(by.lanes)),
        short_packs_(static_cast<std::uint32_t>(by.short_packs)),
        place_(tables_.place),
        site_mass_(program.position.size(), nowhere),
        force_(program.position.size(), nowhere) {
    place_.assign(program.position.size(), nowhere);
  }

  ChainsTables make() {
    fold_chains();
    place_others();
    find_sites();
    number_loose();
    find_listened();
    place_taps();
    make_links();
    place_passive();
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      const InputSlot& input = program_.inputs[i];
      (input.is_force ? tables_.forces : tables_.positions)
          .push_back({place_[input.node], force_at(input.node), i});
    }
    make_outputs();
    if (short_packs_ > 0) {
      shorten();
    }
    return std::move(tables_);
  }

 private:
  std::uint32_t next_force() { return static_cast<std::uint32_t>(tables_.force_count++); }

  // Returns the place of the position in this lane of a pair.
  ChainPlace place_of(std::uint32_t pair, std::uint32_t lane) const {
    return 2 * lanes_ * pair + lane;
  }

  void fold_chains() {
    std::uint32_t next = 0;
    for (const Chain& chain : form_.chains) {
      const std::uint32_t packs =
          short_packs_ > 0 ? short_packs_ : (chain.count + lanes_ - 1) / lanes_;
      for (std::uint32_t i = 0; i < chain.count; ++i) {
        const std::uint32_t node = form_.nodes[chain.first + i];
        place_[node] = place_of(next + i % packs, i / packs);
        site_mass_[node] = program_.mass_runs[chain.mass_run].inverse_mass;
      }
      tables_.chains.push_back({.first = place_of(next, 0),
                                .packs = packs,
                                .last = (chain.count - 1) % packs,
                                .is_stiff = chain.is_stiff,
                                .springs = {chain.stiffness, chain.damping, chain.second_stiffness,
                                            chain.second_damping},
                                .mass = program_.mass_runs[chain.mass_run]});
      next += packs;
    }
    tables_.pairs = next;
  }

  void place_others() {
    std::uint32_t others = 0;
    for (ChainPlace& place : place_) {
      if (place == nowhere) {
        place =
            place_of(static_cast<std::uint32_t>(tables_.pairs) + others / lanes_, others % lanes_);
        ++others;
      }
    }
    tables_.pairs += (others + lanes_ - 1) / lanes_;
    for (std::size_t i = 0; i < form_.chains.size(); ++i) {
      const auto place = [&](std::uint32_t node) {
        return node == Chain::free ? nowhere : place_[node];
      };
      const Chain& chain = form_.chains[i];
      FoldedChain& folded = tables_.chains[i];
      folded.left = place(chain.left);
      folded.right = place(chain.right);
      for (std::size_t end = 0; end < 2; ++end) {
        folded.second_left[end] = place(chain.second_left[end]);
        folded.second_right[end] = place(chain.second_right[end]);
      }
    }
  }

  ChainSite site_of(std::uint32_t node) const {
    const std::uint32_t lane = place_[node] % lanes_;
    return {place_[node] - lane, lane * lanes_, site_mass_[node]};
  }

  // Finds the masses of chains that have other links, or whose force is an output.
  void find_sites() {
    const auto touch = [&](std::uint32_t node) {
      if (site_mass_[node] != nowhere && force_[node] == nowhere) {
        force_[node] = next_force();
        tables_.sites.push_back(site_of(node));
      }
    };
    for (const std::uint32_t link : form_.links) {
      touch(program_.ends[link].a);
      touch(program_.ends[link].b);
    }
    for (const InputSlot& input : program_.inputs) {
      touch(input.node);
    }
    for (const OutputSlot& output : program_.outputs) {
      if (output.is_force) {
        touch(output.node);
      }
    }
  }

  void number_loose() {
    std::size_t run = 0;
    for (const std::uint32_t node : form_.loose) {
      const auto& runs = program_.mass_runs;
      for (; node >= runs[run].first + runs[run].count; ++run) {
      }
      auto& loose_runs = tables_.loose_runs;
      if (loose_runs.empty() || loose_runs.back().mass.first != runs[run].first) {
        loose_runs.push_back({.mass = runs[run]});
      }
      ++loose_runs.back().count;
      force_[node] = next_force();
      tables_.loose.push_back(place_[node]);
    }
  }

  // The force on a fixed node matters only to an output.
  void find_listened() {
    for (const OutputSlot& output : program_.outputs) {
      if (output.is_force && force_[output.node] == nowhere) {
        force_[output.node] = next_force();
        tables_.listened.push_back(force_[output.node]);
      }
    }
  }

  // If nobody reads the sum, each end of a link has a force slot of its own, so that no addition
  // waits for another.
  std::uint32_t force_at(std::uint32_t node) {
    return force_[node] == nowhere ? next_force() : force_[node];
  }

  void make_links() {
    std::size_t run = 0;
    for (const std::uint32_t link : form_.links) {
      const auto& runs = program_.link_runs;
      std::size_t of = run;
      for (; link >= runs[of].first + runs[of].count; ++of) {
      }
      if (runs[of].scheme != Scheme::plain) {
        continue;
      }
      auto& link_runs = tables_.link_runs;
      if (link_runs.empty() || of != run) {
        link_runs.push_back(runs[of]);
        link_runs.back().first = static_cast<std::uint32_t>(tables_.ends.size());
        link_runs.back().count = 0;
      }
      run = of;
      ++link_runs.back().count;
      const auto [a, b] = program_.ends[link];
      tables_.ends.push_back({place_[a], place_[b], force_at(a), force_at(b)});
    }
  }

  void place_passive() {
    const std::vector<std::uint32_t> inverse_mass = inverse_masses(program_);
    for (std::uint32_t node = 0; node < place_.size() && !is_plain(program_); ++node) {
      tables_.passive_ends.push_back(
          {.place = place_[node],
           .unit = site_mass_[node] != nowhere ? site_of(node).unit : nowhere,
           .inverse_mass = node < program_.moving ? inverse_mass[node] : nowhere});
    }
  }

  void make_outputs() {
    for (std::uint32_t i = 0; i < program_.outputs.size(); ++i) {
      const OutputSlot& output = program_.outputs[i];
      const ChainPlace place = place_[output.node];
      if (output.is_force) {
        const auto first = static_cast<std::uint32_t>(tables_.probes.size());
        add_probes(output.node);
        const auto count = static_cast<std::uint32_t>(tables_.probes.size()) - first;
        tables_.heard_forces.push_back({place, i, force_[output.node], first, count});
      } else {
        tables_.heard_positions.push_back({place, i});
      }
    }
  }

  void place_taps() {
    for (const TapSlot& tap : program_.taps) {
      force_[tap.node] = next_force();
      tables_.taps.push_back({tap, place_[tap.node], force_[tap.node]});
    }
    for (const std::uint32_t node : program_.tap_nodes) {
      PlacedNode placed{.place = place_[node], .force = nowhere, .site = {}};
      if (site_mass_[node] != nowhere) {
        placed.site = site_of(node);
      } else {
        placed.force = force_at(node);
      }
      tables_.tap_nodes.push_back(placed);
    }
  }

  // Adds the springs of chains at a node.
  void add_probes(std::uint32_t node) {
    for (const Chain& chain : form_.chains) {
      const std::uint32_t* const nodes = form_.nodes.data() + chain.first;
      const std::uint32_t* const last = nodes + chain.count - 1;
      const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t k, std::uint32_t z) {
        if (a != Chain::free && (a == node || b == node)) {
          tables_.probes.push_back({place_[a == node ? b : a], k, z});
        }
      };
      const auto add_row = [&](std::uint32_t reach, std::uint32_t k, std::uint32_t z) {
        for (std::uint32_t i = 0; i + reach < chain.count; ++i) {
          add(nodes[i], nodes[i + reach], k, z);
        }
      };
      add(chain.left, nodes[0], chain.stiffness, chain.damping);
      add(chain.right, *last, chain.stiffness, chain.damping);
      add_row(1, chain.stiffness, chain.damping);
      if (chain.is_stiff) {
        for (std::uint32_t i = 0; i < 2; ++i) {
          add(chain.second_left[i], nodes[i], chain.second_stiffness, chain.second_damping);
          add(chain.second_right[i], *(last - i), chain.second_stiffness, chain.second_damping);
        }
        add_row(2, chain.second_stiffness, chain.second_damping);
      }
    }
  }

  // Prepares the step of a single chain that stays in registers.
  void shorten() {
    for (std::uint32_t i = 0; i < tables_.sites.size(); ++i) {
      const ChainSite& site = tables_.sites[i];
      tables_.short_sites.push_back({site.pair / (2 * lanes_), site.unit, i});
    }
    std::stable_sort(tables_.short_sites.begin(), tables_.short_sites.end(),
                     [](const ShortSite& a, const ShortSite& b) { return a.pack < b.pack; });
    tables_.short_sites.emplace_back();
    const auto read = [&](ChainPlace place) {
      const std::uint32_t pair = place / (2 * lanes_);
      tables_.short_read |= pair < short_packs_ ? 1u << pair : 0u;
    };
    for (const PlacedEnds& ends : tables_.ends) {
      read(ends.a);
      read(ends.b);
    }
    for (const HeardPosition& output : tables_.heard_positions) {
      read(output.place);
    }
    const std::uint32_t count = form_.chains[0].count;
    if (count < short_packs_ * lanes_) {
      tables_.short_end = place_of(count % short_packs_, count / short_packs_);
    }
  }

  const Program& program_;
  const Chains& form_;
  std::uint32_t lanes_;
  std::uint32_t short_packs_;
  ChainsTables tables_;
  std::vector<ChainPlace>& place_;
  std::vector<std::uint32_t> site_mass_;  // [node] Coefficient, if the node is in a chain.
  std::vector<std::uint32_t> force_;      // [node]
};

template <Isa isa, class T>
ChainsLoops<T> loops_for(FoldedBy by) {
  ChainsLoops<T> loops = chains_loops<isa, T>(by.lanes * sizeof(T));
  if (by.short_packs > 0) {
    loops.step = short_chain_step<isa, T>(by.lanes * sizeof(T), by.short_packs);
  }
  return loops;
}

}  // namespace

template <class T>
ChainsKernel<T>::ChainsKernel(const Program& program, const Chains& form, std::size_t, Isa isa)
    : ChainsKernel(program, form,
                   TablesMaker(program, form, fold_by(program, form, isa, sizeof(T))).make(),
                   fold_by(program, form, isa, sizeof(T)), isa) {}

template <class T>
ChainsKernel<T>::ChainsKernel(const Program& program, const Chains& form, ChainsTables tables,
                              FoldedBy by, Isa isa)
    : NodeKernel<T>(program, {.node = tables.place,
                              .lane = {0},
                              .row = by.lanes,
                              .rows = 2,
                              .size = 2 * by.lanes * tables.pairs}),
      tables_(std::move(tables)),
      loops_(with_isa(isa, [&]<Isa level>() { return loops_for<level, T>(by); })),
      masks_(4 * by.lanes * tables_.chains.size()),
      units_(by.lanes * by.lanes),
      held_(4 * tables_.chains.size()),
      force_(tables_.force_count),
      tap_pull_(program.taps.size()) {
  const std::size_t lanes = by.lanes;
  for (std::size_t i = 0; i < form.chains.size(); ++i) {
    const std::uint32_t packs = tables_.chains[i].packs;
    const std::size_t last_lane = (form.chains[i].count - 1) / packs;
    T* const masks = masks_.data() + 4 * lanes * i;
    std::fill_n(masks, last_lane + 1, T(1));
    std::fill_n(masks + lanes, last_lane, T(1));
    masks[2 * lanes + last_lane] = T(1);
    masks[3 * lanes + (form.chains[i].count - 2) / packs] = T(1);
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    units_[lane * lanes + lane] = T(1);
  }
  this->reset_lanes();
}

template <class T>
void ChainsKernel<T>::clear(std::size_t) {
  // Clears empty places of packs, too, in case they hold NaN.
  for (auto* zero : {&this->nodes_.numbers, &held_, &force_, &tap_pull_}) {
    std::fill(zero->begin(), zero->end(), T(0));
  }
}

template <class T>
bool ChainsKernel<T>::copy_from(const Kernel<T>& from) {
  const auto& other = static_cast<const ChainsKernel&>(this->copy_nodes(from));
  held_ = other.held_;
  force_ = other.force_;
  tap_pull_ = other.tap_pull_;
  return true;
}

template <class T>
ChainsState<T> ChainsKernel<T>::state() {
  return {.ramps = ramps_of(this->coefficients),
          .masks = masks_.data(),
          .units = units_.data(),
          .bodies = this->nodes_.numbers.data(),
          .held = held_.data(),
          .force = force_.data(),
          .corners = this->nodes_.corners.data(),
          .tap_pull = tap_pull_.data(),
          .passive = this->nodes_.passive.tables,
          .memory = this->nodes_.passive.memory.data(),
          .solver = this->nodes_.passive.numbers.data(),
          .awake = this->nodes_.passive.awake.data()};
}

template <class T>
void ChainsKernel<T>::play(const Block<T>& block) {
  ChainsState<T> played = state();
  loops_.step(this->program_, tables_, played, block);
  this->coefficients.finish(block.frames);
}

template class ChainsKernel<float>;
template class ChainsKernel<double>;

}  // namespace ressort::kernels
