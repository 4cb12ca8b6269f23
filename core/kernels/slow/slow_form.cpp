#include "core/kernels/slow/slow_form.h"

#include <algorithm>

#include "core/kernels/direct/fourth_form.h"
#include "core/laws/laws.h"

namespace ressort {
namespace {

constexpr std::uint32_t least_frames = 4;
constexpr std::uint32_t most_frames = 1024;

// The same in the fourth-order form.
std::shared_ptr<const Program> formed(Program program) {
  auto form = fourth_form(program);
  if (!form) {
    return nullptr;
  }
  program.form = *std::move(form);
  return std::make_shared<const Program>(std::move(program));
}

Program slowed(Program program, std::uint32_t frames) {
  program.rate_hz /= frames;
  program.rate_ratio *= frames;
  for (double& velocity : program.velocity) {
    velocity *= frames;
  }
  return program;
}

}  // namespace

std::optional<Slow> slow_by(const Program& program, std::uint32_t frames) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  const auto is_spring = [](const LinkRun& run) { return run.law == Law::spring; };
  if (!program.taps.empty() || !program.audio_coefficients.empty() ||
      std::any_of(program.outputs.begin(), program.outputs.end(), is_force) ||
      !std::all_of(program.link_runs.begin(), program.link_runs.end(), is_spring)) {
    return std::nullopt;
  }
  Slow slow{.fine = formed(program), .coarse = formed(slowed(program, frames)), .frames = frames};
  if (!slow.fine || !slow.coarse) {
    return std::nullopt;
  }
  return slow;
}

std::optional<Slow> slow_form(const Program& program, double highest_factor) {
  const Steepness steepness = steepness_of(program);
  std::uint32_t frames = most_frames;
  const auto is_slow = [&] {
    const double k = steepness.stiffness * highest_factor * frames * frames;
    return k <= most_slow_stiffness && steepness.damping * frames <= most_slow_damping;
  };
  while (frames >= least_frames && !is_slow()) {
    frames /= 2;
  }
  return frames >= least_frames ? slow_by(program, frames) : std::nullopt;
}

}  // namespace ressort
