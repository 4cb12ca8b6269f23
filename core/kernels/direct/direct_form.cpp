#include "core/kernels/direct/direct_form.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/waveguides/rails.h"

namespace ressort {

namespace {

// Places on macros are moved and spread lane by lane, those on bodies by all modes, in packs.
double taps_ns(const Program& program, double lanes, double packs) {
  double ns = 0.0;
  for (const TapSlot& tap : program.taps) {
    ns += tap.is_on_body() ? 1.2 * tap.length * packs : 10.0 * lanes;
  }
  return ns;
}

}  // namespace

double predicted_ns(const Program& program, const Direct&, const Workload& load) {
  const auto widest = static_cast<double>(vector_bytes(load.isa)) / (load.is_double ? 8.0 : 4.0);
  const LinkCount links = links_of(program);
  const double packs = packs_of(load);
  const double lanes = std::ceil(load.voices / widest) * std::min<double>(load.voices, widest);
  return packs * (12.0 + 1.5 * passive_ns(program) +
                  1.6 * (program.moving + links.springs + links.bent) + 5.0 * links.others) +
         taps_ns(program, lanes, packs) +
         lanes * 3.0 * static_cast<double>(program.waveguides.size() + program.junctions.size());
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

// A third more than without.
double predicted_ns(const Program& program, const Compensated&, const Workload& load) {
  return (is_wide(load) ? 1.3 : 4.0) * predicted_ns(program, Direct{}, load);
}

std::string description(const Program&, const Compensated&) {
  return "mass by mass and link by link, as published, each position in two numbers";
}

std::uint64_t voice_bytes(const Program& program, const Compensated&, std::uint64_t number_bytes) {
  return bytes_with_shared_links(program, number_bytes);
}

}  // namespace ressort
