#include "core/kernels/direct/direct_form.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/kernels/waveguides/rails.h"

namespace ressort::kernels {

// Points on macros are computed lane by lane, points on bodies over all modes in packs.
Work work(const Program& program, const Direct&, const Workload& load) {
  const double packs = packs_of(load);
  const double widest = static_cast<double>(vector_bytes(load.isa)) / bytes_of_number(load);
  const double lanes = std::ceil(load.voices / widest) * std::min<double>(load.voices, widest);
  const LinkCount links = links_of(program);
  const auto waves = static_cast<double>(program.waveguides.size() + program.junctions.size());
  const double full = lanes > widest / 2.0 ? packs : 0.0;
  Work work;
  work.add(Item::direct_sample, packs)
      .add(Item::direct_mass, packs * program.moving)
      .add(Item::direct_spring, packs * (links.springs + links.bent))
      .add(Item::direct_link, packs * links.others)
      .add(Item::direct_full_step, full * (program.moving + links.springs + links.bent))
      .add(Item::direct_full_link, full * links.others)
      .add(Item::direct_passive, packs * passive_ns(program))
      .add(Item::direct_waveguide, lanes * waves)
      .add(Item::direct_waveguide_pack, packs * waves);
  for (const TapSlot& tap : program.taps) {
    tap.is_on_body() ? work.add(Item::direct_body_mode, packs * tap.length)
                     : work.add(Item::direct_place, lanes);
  }
  const double numbers = 3.0 * std::max(2.0, std::min<double>(load.voices, widest));
  const double bytes = numbers * bytes_of_number(load) * program.moving +
                       8.0 * static_cast<double>(program.ends.size());
  return work.add(Item::direct_line, packs * lines_of(bytes))
      .add(Item::direct_far_line, packs * far_lines_of(bytes));
}

std::string description(const Program& program, const Direct&) {
  const std::string words = "mass by mass and link by link, as published, a voice in each lane";
  return program.waveguides.empty()
             ? words
             : words + "; with " + count_of(program.waveguides.size(), "waveguide", "waveguides");
}

std::uint64_t voice_bytes(const Program& program, const Direct&, std::uint64_t number_bytes) {
  return bytes_with_shared_links(program, number_bytes) +
         number_bytes * waveguide_slots(program) * program.waveguides.size();
}

}  // namespace ressort::kernels
