#include "core/kernels/direct/direct_form.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/kernels/waveguides/rails.h"

namespace ressort::kernels {

// Counts per pack of voices: a mass costs three operations, a spring four, and any other law a
// branch and twice as many. A point on a macro is interpolated lane by lane, and a place of a body
// is a sum over all modes.
double operations(const Program& program, const Direct&, const Workload& load) {
  const double packs = packs_of(load);
  const double widest = static_cast<double>(vector_bytes(load.isa)) / bytes_of_number(load);
  const double lanes = std::ceil(load.voices / widest) * std::min<double>(load.voices, widest);
  const LinkCount links = links_of(program);
  // More than half a register is filled: the pack moves twice the bytes, mass by mass and link by
  // link.
  const double width = lanes > widest / 2.0 ? 1.4 : 1.0;
  double count =
      48.0 +
      width * (3.0 * program.moving + 4.0 * (links.springs + links.bent) + 16.0 * links.others) +
      1.5 * passive_operations(program) +
      6.0 * static_cast<double>(program.waveguides.size() + program.junctions.size());
  double places = 0.0;
  for (const TapSlot& tap : program.taps) {
    (tap.is_on_body() ? count : places) += tap.is_on_body() ? 5.0 * tap.length : 125.0;
  }
  const double numbers = 3.0 * std::max(2.0, std::min<double>(load.voices, widest));
  const double bytes = numbers * bytes_of_number(load) * program.moving +
                       8.0 * static_cast<double>(program.ends.size());
  return packs * (count + 2.0 * lines_of(bytes) + 10.0 * far_lines_of(bytes)) + lanes * places;
}

std::string description(const Program& program, const Direct&) {
  const std::string words = "mass by mass and link by link, as published, one voice per lane";
  return program.waveguides.empty()
             ? words
             : words + "; with " + count_of(program.waveguides.size(), "waveguide", "waveguides");
}

std::uint64_t voice_bytes(const Program& program, const Direct&, std::uint64_t number_bytes) {
  return bytes_with_shared_links(program, number_bytes) +
         number_bytes * waveguide_slots(program) * program.waveguides.size();
}

}  // namespace ressort::kernels
