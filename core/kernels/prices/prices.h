// core/kernels: what forms do in a sample, counted, and what each of these things takes on a kind
// of machine. All predictions of time are such sums; `tests/bench/run --fit` measures the prices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/kernels/isa.h"

namespace ressort::kernels {

// Named by their form. A pack is a register full of numbers; a line 64 bytes that are not in the
// nearest cache, a far one not in the second either.
enum class Item : std::uint8_t {
  direct_sample,  // a pack of voices, as all that follow
  direct_mass,
  direct_spring,
  direct_link,       // of any other law
  direct_full_step,  // of a mass or a link in all lanes of the widest registers, besides
  direct_full_link,
  direct_passive,
  direct_place,  // on a macro, in one voice
  direct_body_mode,
  direct_waveguide,       // or junction, in one voice
  direct_waveguide_pack,  // in all of a pack
  direct_line,
  direct_far_line,
  chains_sample,
  chains_short_sample,  // where all of it stays in registers
  chains_short_pack,
  chains_chain,
  chains_pair,  // of packs
  chains_wide_pair,
  chains_stiff_chain,
  chains_stiff_pair,
  chains_held,  // where any link is one by one
  chains_spring,
  chains_link,
  chains_loose,  // mass
  chains_signal,
  chains_place,
  chains_moving_pair,  // while a parameter moves
  chains_passive,
  chains_line,
  chains_far_line,
  grid_sample,
  grid_segment,
  grid_pack,
  grid_offset,  // of a pack
  grid_spring,  // of a pack
  grid_link,    // of a pack
  grid_rest,
  grid_place,
  grid_passive,
  grid_line,
  grid_far_line,
  batch_one,  // pack alone
  batch_one_mass,
  batch_one_link,
  batch_sample,
  batch_pull,  // of a mass or a spring in registers, a pack
  batch_link,
  batch_wide_step,  // of a mass or a link in memory
  batch_wide_pull,  // the same, a pack
  batch_wide_link,  // of any law but a spring's, besides
  batch_passive,
  modal_sample,
  modal_mode,
  modal_output,  // of a mode
  modal_push,    // of a mode
  modal_heard,   // an output
  modal_held_sample,
  modal_place,
  modal_held_mode,
  modal_row,          // of a mode
  modal_held_output,  // of a mode
  modal_wide_mode,    // of more than 8 rows
  modal_wide_row,
  modal_moving_sample,  // while a parameter moves
  modal_moving_mode,
  modal_line,
  modal_passive,
  modal_passive_mode,
  count
};
inline constexpr auto item_count = static_cast<std::size_t>(Item::count);

// What one of it takes, in ns, in double and in float.
struct Price {
  Item item;
  std::string_view name;
  double float64;
  double float32;
};
using Prices = std::array<Price, item_count>;

// Of the kind of machine that has these instructions. [any thread]
const Prices& prices_of(Isa isa);

// How often each thing is done in a sample, for all voices.
class Work {
 public:
  Work& add(Item item, double times) {
    times_[static_cast<std::size_t>(item)] += times;
    return *this;
  }
  double of(Item item) const { return times_[static_cast<std::size_t>(item)]; }
  // In ns.
  double cost(Isa isa, bool is_double) const;

  friend Work operator*(double times, Work work) {
    for (double& each : work.times_) {
      each *= times;
    }
    return work;
  }

 private:
  std::array<double, item_count> times_{};
};

}  // namespace ressort::kernels
