#include "core/compile/chorus_form.h"

#include <algorithm>

namespace ressort {
namespace {

// Whether the spring is one of those held; it is then put there.
bool hold_spring(const Program& program, std::uint32_t run, Ends ends, Chorus& chorus) {
  const auto [a, b] = std::minmax(ends.a, ends.b);
  if (program.link_runs[run].law != Law::spring || program.moving > most_held_masses ||
      a >= program.moving || a == b) {
    return false;
  }
  std::uint32_t& place =
      b < program.moving ? chorus.pairs[b * (b - 1) / 2 + a] : chorus.anchors[a].run;
  if (place != ChorusAnchor::none) {
    return false;
  }
  place = run;
  if (b >= program.moving) {
    chorus.anchors[a].node = b;
  }
  return true;
}

}  // namespace

std::optional<Chorus> chorus_form(const Program& program) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  if (program.moving == 0 || program.moving > most_chorus_masses || !program.taps.empty() ||
      std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
    return std::nullopt;
  }
  Chorus chorus;
  chorus.pairs.fill(ChorusAnchor::none);
  for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
    const auto first = static_cast<std::uint32_t>(chorus.ends.size());
    const LinkRun& links = program.link_runs[run];
    for (std::uint32_t i = links.first; i < links.first + links.count; ++i) {
      if (!hold_spring(program, run, program.ends[i], chorus)) {
        chorus.ends.push_back({program.ends[i].a, program.ends[i].b});
      }
    }
    if (const auto count = static_cast<std::uint32_t>(chorus.ends.size()) - first; count > 0) {
      chorus.links.push_back({run, first, count});
    }
  }
  return chorus;
}

}  // namespace ressort
