#include "core/kernels/slow/slow_form.h"

#include <algorithm>

#include "core/kernels/direct/fourth_form.h"
#include "core/kernels/registry.h"
#include "core/laws/laws.h"

namespace ressort::kernels {
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

// A voice's outputs, and its share of a coarse step.
double predicted_ns(const Program& program, const Slow& form, const Workload& load) {
  Workload one = load;
  one.voices = 1;
  return load.voices * (4.0 + 3.0 * static_cast<double>(program.outputs.size()) +
                        predicted_ns(*form.coarse, one) / form.frames);
}

std::string description(const Program&, const Slow& form) {
  return "to fourth order once in " + std::to_string(form.frames) +
         " samples, a cubic between; what comes in acts up to " + std::to_string(2 * form.frames) +
         " samples later";
}

std::uint64_t voice_bytes(const Program&, const Slow& form, std::uint64_t number_bytes) {
  return voice_bytes(*form.fine, number_bytes) + voice_bytes(*form.coarse, number_bytes);
}

}  // namespace ressort::kernels
