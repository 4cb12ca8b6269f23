// core/model: links that cannot gain energy, in FAUST: what holds a waveguide is solved by these
// definitions, as core/laws solves it. All pure text, for faust_joint.cpp and faust_words.cpp.
#pragma once

#include <span>
#include <string_view>

#include "core/rooms.h"

namespace ressort::model {

struct FaustDefinition {
  std::string_view name;
  std::string_view text;
};

// How often Newton's method is written out, for one link and for several at once. Each goes on from
// where the last has come, and stays where it has arrived.
inline constexpr int faust_newtons = 24;
inline constexpr int faust_joint_newtons = 10;

// Of every law NAME, its arguments being those of a sample at the rate in use:
//   steady_NAME(ARGUMENTS, now, speed, way) = force, damping
//     what it exerts wherever it goes, and adds for every unit that it goes in two samples
//   gradient_NAME(ARGUMENTS, before, step) = force, slope
//     the discrete gradient; of a bow the friction
//   alone_NAME(ARGUMENTS, force, damping, before, speed, way, gamma) = force
//     what solves both of them, if it would go `way` in two samples and gives way by gamma
// and what they stand on.
std::span<const FaustDefinition> faust_passive_definitions();

}  // namespace ressort::model
