#include "core/kernels/grid/grid_form.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "core/kernels/estimates.h"
#include "core/kernels/grid/grid_places.h"
#include "core/kernels/passive/clusters.h"
#include "core/kernels/taps.h"
#include "core/laws/law.h"

namespace ressort::kernels {
namespace {

// Fits a Program's links into slots. With a spring run, its links act through the sum over
// neighbours and all others are one-by-one links. Without one, the links of every large run are
// computed offset by offset.
class Fit {
 public:
  Fit(const Program& program, std::uint32_t mass_run, GridPlaces places, std::uint32_t spring_run,
      const Progress& progress)
      : program_(program),
        progress_(progress),
        mass_run_(mass_run),
        spring_run_(spring_run),
        places_(std::move(places)),
        slot_(places_.slot),
        slots_(places_.slots),
        is_driven_(driven_nodes(program)),
        copy_(places_.slots, nowhere),
        span_at_(places_.slots, places_.spans.size() == 1 ? 0u : nowhere),
        families_(places_.spans.size()),
        degree_(places_.slots) {
    for (std::uint32_t& slot : slot_) {
      slot = slot == nowhere ? slots_++ : slot;
    }
    for (std::uint32_t i = 0; i < places_.spans.size(); ++i) {
      std::fill_n(span_at_.begin() + places_.spans[i].first, places_.spans[i].count, i);
    }
  }

  std::optional<Grid> make() {
    choose_families();
    join_masses();
    join_grounds();
    if (linked_.empty() || (is_sum() && !count_neighbours()) || !extend()) {
      return std::nullopt;
    }
    write_nodes();
    write_links();
    write_rest();
    return std::move(grid_);
  }

 private:
  // Most times that a slot may be held at 0; fits into int8_t.
  static constexpr std::uint8_t most_held = 100;

  // The links of a run from a slot of one span to the slot `offset` above.
  struct Family {
    std::uint32_t run = 0;
    std::uint32_t offset = 0;
    bool is_reversed = false;  // The first end is above the second.
    auto operator<=>(const Family&) const = default;
  };
  struct Chosen {
    Family family;
    std::uint32_t row = 0;  // Row of linked_.
  };
  struct Left {
    bool is_excess = false;
    std::uint32_t run = 0;
    std::uint32_t a = 0;  // Slots.
    std::uint32_t b = 0;
    auto operator<=>(const Left&) const = default;
  };

  bool is_sum() const { return spring_run_ != nowhere; }
  bool is_regular(std::uint32_t run) const {
    return is_sum() ? run == spring_run_ : program_.link_runs[run].count >= least_regular_links;
  }
  bool is_in_grid(std::uint32_t node) const { return slot_[node] < places_.slots; }
  bool is_ground(std::uint32_t node) const { return node >= program_.moving && !is_driven_[node]; }
  bool is_zero(std::uint32_t node) const {
    return program_.position[node] == 0.0 && program_.velocity[node] == 0.0;
  }
  bool is_mass_at(std::uint32_t slot) const {
    const std::uint32_t node = places_.node_at[slot];
    return node != nowhere && node < program_.moving;
  }

  // Passive links are handled by the kernel itself.
  template <class Use>
  void each_link(Use&& use) const {
    for (std::uint32_t run = 0; run < program_.link_runs.size(); ++run) {
      const LinkRun& links = program_.link_runs[run];
      progress_.spend(8 * std::size_t{links.count});
      for (std::uint32_t i = links.first;
           links.scheme == Scheme::plain && i < links.first + links.count; ++i) {
        use(run, program_.ends[i]);
      }
    }
  }

  Family family_of(std::uint32_t run, std::uint32_t a, std::uint32_t b) const {
    return {run, std::max(a, b) - std::min(a, b),
            a > b && !facts_of(program_.link_runs[run].law).is_odd};
  }

  // Chooses the offsets that many links of a span share. An offset without a neighbour costs the
  // sum its exactness, so rare offsets are left out.
  void choose_families() {
    std::vector<std::map<Family, std::uint32_t>> counts(families_.size());
    each_link([&](std::uint32_t run, Ends ends) {
      if (is_regular(run) && is_in_grid(ends.a) && is_in_grid(ends.b) && ends.a != ends.b) {
        const Family family = family_of(run, slot_[ends.a], slot_[ends.b]);
        if (family.offset <= places_.reach) {
          ++counts[span_at_[std::min(slot_[ends.a], slot_[ends.b])]][family];
        }
      }
    });
    std::size_t rows = 0;
    for (std::size_t span = 0; span < families_.size(); ++span) {
      choose_of_span(counts[span], families_[span]);
      rows = std::max(rows, families_[span].size());
    }
    linked_.assign(rows, std::vector<std::uint8_t>(places_.slots));
    std::set<std::uint32_t> known;
    for (const auto& span : families_) {
      for (const Chosen& chosen : span) {
        if (known.size() < most_grid_offsets && known.insert(chosen.family.offset).second) {
          offsets_.push_back(chosen.family.offset);
        }
      }
    }
  }

  void choose_of_span(const std::map<Family, std::uint32_t>& counts,
                      std::vector<Chosen>& chosen) const {
    constexpr std::uint32_t least_share = 32;
    const std::uint32_t least_count = families_.size() == 1 ? 4 : 1;
    constexpr std::ptrdiff_t most_of_a_law = most_grid_offsets / 2;
    const std::size_t most = is_sum() ? most_of_a_law : most_grid_offsets;
    std::vector<std::pair<Family, std::uint32_t>> sorted(counts.begin(), counts.end());
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const auto& a, const auto& b) { return a.second > b.second; });
    for (const auto& [family, count] : sorted) {
      const auto of_law =
          std::count_if(chosen.begin(), chosen.end(),
                        [run = family.run, reversed = family.is_reversed](const Chosen& other) {
                          return other.family.run == run && other.family.is_reversed == reversed;
                        });
      if (count >= least_count && count * least_share >= sorted.front().second &&
          chosen.size() < most && of_law < most_of_a_law) {
        chosen.push_back({family, static_cast<std::uint32_t>(chosen.size())});
      }
    }
  }

  // Returns the flag for the link of a family between two slots.
  std::uint8_t* linked(const Family& family, std::uint32_t low) {
    if (span_at_[low] != nowhere) {
      for (const Chosen& chosen : families_[span_at_[low]]) {
        if (chosen.family == family) {
          return &linked_[chosen.row][low];
        }
      }
    }
    return nullptr;
  }

  // Adds a link to its family. Returns false if there is no such family or the place is taken.
  bool add(std::uint32_t run, std::uint32_t a, std::uint32_t b) {
    std::uint8_t* const is_linked = linked(family_of(run, a, b), std::min(a, b));
    return is_linked != nullptr && std::exchange(*is_linked, std::uint8_t{1}) == 0;
  }

  void join_masses() {
    each_link([&](std::uint32_t run, Ends ends) {
      const auto [a, b] = ends;
      const bool is_inner = is_in_grid(a) && is_in_grid(b) && a != b;
      const bool is_hung = (is_in_grid(a) && is_ground(b)) || (is_in_grid(b) && is_ground(a));
      if (is_regular(run) && is_inner && add(run, slot_[a], slot_[b])) {
        return;
      }
      if (is_regular(run) && is_hung) {
        held_.push_back({run, ends});
      } else {
        left_.push_back({false, run, slot_[a], slot_[b]});
      }
    });
  }

  // Places copies of grounds where links need them: first at existing copies, then in empty slots.
  void join_grounds() {
    for (const auto& [run, ends] : held_) {
      if (!hold(run, ends, true) && !hold(run, ends, false)) {
        left_.push_back({false, run, slot_[ends.a], slot_[ends.b]});
      }
    }
  }

  bool hold(std::uint32_t run, Ends ends, bool where_it_is) {
    const std::uint32_t ground = is_ground(ends.b) ? ends.b : ends.a;
    const std::uint32_t at = slot_[is_ground(ends.b) ? ends.a : ends.b];
    if (is_sum() && is_zero(ground) && degree_[at] < most_held) {
      ++degree_[at];
      return true;
    }
    const auto may_be_at = [&](std::uint32_t slot) {
      const std::uint32_t other = copy_[slot];
      return places_.node_at[slot] == nowhere &&
             (where_it_is
                  ? other != nowhere && program_.position[other] == program_.position[ground] &&
                        program_.velocity[other] == program_.velocity[ground]
                  : other == nowhere);
    };
    progress_.spend(4 * offsets_.size());
    for (const std::uint32_t offset : offsets_) {
      for (const std::uint32_t slot : {at - offset, at + offset}) {
        const bool is_first = ground == ends.a;
        if (may_be_at(slot) && add(run, is_first ? slot : at, is_first ? at : slot)) {
          copy_[slot] = ground;
          return true;
        }
      }
    }
    return false;
  }

  // Counts the neighbours in each slot's sum. Surplus neighbours are subtracted by one-by-one
  // links, which requires that both ends see each other.
  bool count_neighbours() {
    std::vector<std::set<std::int32_t>> offsets(families_.size());
    for (std::uint32_t low = 0; low < places_.slots; ++low) {
      for (std::size_t i = 0; span_at_[low] != nowhere && i < families_[span_at_[low]].size();
           ++i) {
        const auto& [family, row] = families_[span_at_[low]][i];
        if (linked_[row][low] != 0) {
          const auto offset = static_cast<std::int32_t>(family.offset);
          offsets[span_at_[low]].insert(offset);
          offsets[span_at_[low + family.offset]].insert(-offset);
        }
      }
    }
    for (const auto& span : offsets) {
      grid_.segments.push_back({.offsets = {span.begin(), span.end()}});
      if (span.empty() || span.size() > most_grid_offsets) {
        return false;  // A segment needs at least one offset, because its sum moves the masses.
      }
    }
    for (std::uint32_t slot = 0; slot < places_.slots; ++slot) {
      if (is_mass_at(slot) && !count_neighbours_of(slot)) {
        return false;
      }
    }
    return true;
  }

  bool count_neighbours_of(std::uint32_t slot) {
    for (const std::int32_t offset : grid_.segments[span_at_[slot]].offsets) {
      const std::uint32_t other = slot + static_cast<std::uint32_t>(offset);
      if (places_.node_at[other] == nowhere && copy_[other] == nowhere) {
        continue;
      }
      ++degree_[slot];
      const std::uint8_t* const is_linked =
          linked(family_of(spring_run_, slot, other), std::min(slot, other));
      if (is_linked != nullptr && *is_linked != 0) {
        continue;
      }
      if (families_.size() > 1) {
        return false;
      }
      if (offset > 0 || !is_mass_at(other)) {
        left_.push_back({true, spring_run_, slot, other});
      }
    }
    return true;
  }

  // Extends a single span to cover grounds and links.
  bool extend() {
    GridSpan& first = places_.spans.front();
    std::uint32_t begin = first.first;
    std::uint32_t end = places_.spans.back().first + places_.spans.back().count;
    for (std::uint32_t slot = 0; slot < places_.slots; ++slot) {
      if (copy_[slot] != nowhere) {
        begin = std::min(begin, slot / grid_line * grid_line);
        end = std::max(end, (slot / grid_line + 1) * grid_line);
      }
    }
    const bool is_longer =
        begin != first.first || end != places_.spans.back().first + places_.spans.back().count;
    if (is_longer && places_.spans.size() > 1) {
      return false;
    }
    if (is_longer) {
      first = {begin, end - begin};
    }
    grid_.first = begin;
    grid_.count = end - begin;
    return true;
  }

  template <class U>
  std::vector<U> in_grid(const std::vector<U>& all) const {
    const auto begin = all.begin() + grid_.first;
    return {begin, begin + grid_.count};
  }

  void write_nodes() {
    grid_.slots = slots_;
    grid_.mass_run = mass_run_;
    grid_.slot = slot_;
    grid_.position.assign(slots_, 0.0);
    grid_.velocity.assign(slots_, 0.0);
    const auto put = [&](std::uint32_t slot, std::uint32_t node) {
      grid_.position[slot] = program_.position[node];
      grid_.velocity[slot] = program_.velocity[node];
    };
    std::vector<std::uint8_t> moves(places_.slots);
    for (std::uint32_t slot = 0; slot < places_.slots; ++slot) {
      moves[slot] = is_mass_at(slot) ? 1 : 0;
      if (copy_[slot] != nowhere) {
        put(slot, copy_[slot]);
      }
    }
    for (std::uint32_t node = 0; node < slot_.size(); ++node) {
      put(slot_[node], node);
    }
    for (std::uint32_t run = 0; run < program_.mass_runs.size(); ++run) {
      const MassRun& masses = program_.mass_runs[run];
      for (std::uint32_t node = masses.first; node < masses.first + masses.count; ++node) {
        if (!is_in_grid(node)) {
          grid_.loose.push_back({run, slot_[node]});
        }
      }
    }
    grid_.moves = in_grid(moves);
  }

  std::vector<std::int8_t> missing() const {
    std::vector<std::int8_t> all(places_.slots);
    for (std::uint32_t slot = 0; slot < places_.slots; ++slot) {
      if (is_mass_at(slot)) {
        const std::size_t offsets = grid_.segments[span_at_[slot]].offsets.size();
        all[slot] = static_cast<std::int8_t>(static_cast<int>(offsets) - degree_[slot]);
      }
    }
    return all;
  }

  void write_links() {
    if (is_sum()) {
      grid_.spring_run = spring_run_;
      grid_.missing = in_grid(missing());
      for (std::size_t i = 0; i < places_.spans.size(); ++i) {
        grid_.segments[i].first = places_.spans[i].first;
        grid_.segments[i].count = places_.spans[i].count;
      }
      return;
    }
    std::map<std::pair<std::uint32_t, bool>, GridLinks> laws;
    for (const auto& [family, row] : families_.front()) {
      GridLinks& links = laws[{family.run, family.is_reversed}];
      links.run = family.run;
      links.is_reversed = family.is_reversed;
      links.offsets.push_back(family.offset);
      links.is_linked.push_back(in_grid(linked_[row]));
    }
    for (auto& [law, links] : laws) {
      grid_.links.push_back(std::move(links));
    }
  }

  void write_rest() {
    std::stable_sort(left_.begin(), left_.end(), [](const Left& a, const Left& b) {
      return std::tie(a.is_excess, a.run) < std::tie(b.is_excess, b.run);
    });
    std::set<std::uint32_t> pushed;
    for (const Left& left : left_) {
      if (grid_.rest.empty() || grid_.rest.back().run != left.run ||
          grid_.rest.back().is_excess != left.is_excess) {
        const auto first = static_cast<std::uint32_t>(grid_.rest_ends.size());
        grid_.rest.push_back({.run = left.run, .first = first, .is_excess = left.is_excess});
      }
      ++grid_.rest.back().count;
      grid_.rest_ends.push_back({left.a, left.b});
      pushed.insert({left.a, left.b});
    }
    for (const InputSlot& input : program_.inputs) {
      if (input.is_force) {
        pushed.insert(slot_[input.node]);
      }
    }
    grid_.ports.assign(pushed.begin(), pushed.end());
  }

  const Program& program_;
  const Progress& progress_;
  std::uint32_t mass_run_;
  std::uint32_t spring_run_;  // The run, or nowhere.
  GridPlaces places_;
  std::vector<std::uint32_t> slot_;  // [node] Nodes outside the grid come last.
  std::uint32_t slots_;
  std::vector<bool> is_driven_;                       // [node]
  std::vector<std::uint32_t> copy_;                   // [slot] A ground copied here, or nowhere.
  std::vector<std::uint32_t> span_at_;                // [slot]
  std::vector<std::vector<Chosen>> families_;         // [span]
  std::vector<std::uint32_t> offsets_;                // All offsets, at most most_grid_offsets.
  std::vector<std::vector<std::uint8_t>> linked_;     // [row][slot] Flag at the lower end.
  std::vector<std::uint8_t> degree_;                  // [slot]
  std::vector<std::pair<std::uint32_t, Ends>> held_;  // Run and ends of links to grounds.
  std::vector<Left> left_;
  Grid grid_;
};

// Returns a rough cost per sample, in units of the cheaper slot.
double cost(const Grid& grid) {
  const double slot = grid.segments.empty() ? 2.5 : 1.0;
  return slot * grid.count + 20.0 * static_cast<double>(grid.segments.size()) +
         10.0 * static_cast<double>(grid.rest_ends.size()) +
         16.0 * static_cast<double>(grid.loose.size());
}

std::size_t most_slots(const Program& program) {
  return 64 + 4 * std::size_t{program.moving};
}

// Returns whether few links are left over.
bool is_worth_it(const Program& program, const Grid& grid) {
  return grid.rest_ends.size() <= 24 + program.ends.size() / 16 &&
         grid.loose.size() <= 8 + program.moving / 16 && grid.count <= most_slots(program);
}

// Returns the run with the most masses.
std::uint32_t largest_mass_run(const Program& program) {
  const auto largest =
      std::max_element(program.mass_runs.begin(), program.mass_runs.end(),
                       [](const MassRun& a, const MassRun& b) { return a.count < b.count; });
  return static_cast<std::uint32_t>(largest - program.mass_runs.begin());
}
std::uint32_t largest_spring_run(const Program& program) {
  std::uint32_t largest = nowhere;
  for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
    const LinkRun& links = program.link_runs[run];
    if (is_linear(links.law) && links.scheme == Scheme::plain &&
        links.count >= least_regular_links &&
        (largest == nowhere || links.count > program.link_runs[largest].count)) {
      largest = run;
    }
  }
  return largest;
}

}  // namespace

std::optional<Grid> grid_form(const Program& program, const Progress& progress) {
  const bool has_force_output =
      std::any_of(program.outputs.begin(), program.outputs.end(),
                  [](const OutputSlot& output) { return output.is_force; });
  if (program.moving < least_grid_masses || has_force_output || holds_places(program) ||
      has_bodies(program)) {
    return std::nullopt;
  }
  const std::uint32_t mass_run = largest_mass_run(program);
  const std::uint32_t spring_run = largest_spring_run(program);
  const GridGraph graph = grid_graph(program, mass_run);
  const std::size_t most = most_slots(program);
  std::optional<Grid> best;
  const auto offer = [&](std::optional<GridPlaces> places, std::uint32_t springs) {
    progress.spend(8 * program.position.size());
    if (!places) {
      return;
    }
    std::optional<Grid> grid = Fit(program, mass_run, *std::move(places), springs, progress).make();
    progress.spend(8 * program.ends.size());
    if (grid && is_worth_it(program, *grid) && (!best || cost(*grid) < cost(*best))) {
      best = std::move(grid);
    }
  };
  for (const bool is_written : {true, false}) {
    const GridRows rows =
        is_written ? rows_as_written(program, graph, progress) : rows_by_walk(graph, progress);
    progress.spend(8 * program.ends.size());
    if (rows.empty()) {
      return std::nullopt;
    }
    if (spring_run != nowhere) {
      offer(places_in_lines(graph, rows, most, progress), spring_run);
      offer(places_by_row(graph, rows, most, progress), spring_run);
    }
    offer(places_in_lines(graph, rows, most, progress), nowhere);
  }
  return best;
}

// Counts per voice: five operations a pack of slots and one for each offset, or seven for every
// link law; links that fit into no row are stepped number by number.
double operations(const Program& program, const Grid& form, const Workload& load) {
  const double lanes = static_cast<double>(grid_pack_bytes(load.isa)) / bytes_of_number(load);
  double count = 60.0 + 8.0 * static_cast<double>(form.rest_ends.size() + form.ports.size()) +
                 150.0 * static_cast<double>(program.taps.size()) + passive_operations(program);
  for (const GridSegment& segment : form.segments) {
    count += 12.0 + segment.count / lanes * (5.0 + static_cast<double>(segment.offsets.size()));
  }
  for (const GridLinks& links : form.links) {
    count += 7.0 * form.count / lanes * static_cast<double>(links.offsets.size());
  }
  const double bytes = 3.0 * bytes_of_number(load) * form.count;
  return load.voices * (count + 0.5 * lines_of(bytes) + 5.0 * far_lines_of(bytes));
}

std::string description(const Program&, const Grid& form) {
  return std::string(form.segments.empty() ? "forces" : "rows of equal masses") +
         " in vectors along the index, " + count_of(form.rest_ends.size(), "link", "links") +
         " one by one";
}

std::uint64_t voice_bytes(const Program& program, const Grid& form, std::uint64_t number_bytes) {
  return bytes_with_own_links(program, form.rest_ends.size(), number_bytes);
}

}  // namespace ressort::kernels
