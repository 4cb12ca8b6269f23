#include "core/kernels/estimates.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/passive/clusters.h"
#include "core/laws/law.h"

namespace ressort::kernels {
namespace {

// position, velocity, force and two numbers of the kernel
constexpr std::uint64_t numbers_of_node = 5;
constexpr std::uint64_t numbers_of_link = 1;  // per link, if a kernel has one number for all voices
constexpr std::uint64_t bytes_of_link = 48;   // size in tables
constexpr std::uint64_t numbers_of_coefficient = 3;

}  // namespace

LinkCount links_of(const Program& program) {
  LinkCount count;
  for (const LinkRun& run : program.link_runs) {
    if (run.scheme != Scheme::plain) {
      continue;
    }
    const bool only_pulls = facts_of(run.law).contains_spring;
    (is_linear(run.law) ? count.springs : only_pulls ? count.bent : count.others) += run.count;
  }
  return count;
}

double passive_operations(const Program& program) {
  // operations of about three iterations of Newton's method
  constexpr double of_a_shared_link = 480.0;
  constexpr double of_a_spring_in_web = 16.0;
  if (const std::size_t springs = springs_of_web(program); springs > 0) {
    double sum = of_a_spring_in_web * static_cast<double>(springs);
    for (const LinkRun& run : program.link_runs) {
      const LawFacts& law = facts_of(run.law);
      const bool is_solved = run.scheme != Scheme::plain && !(law.contains_spring && law.is_curved);
      sum += is_solved ? run.count * (law.solve_operations + of_a_shared_link) : 0.0;
    }
    return sum;
  }
  std::vector<std::uint8_t> holders(program.position.size(), 0);
  const auto each = [&](auto&& use) {
    for (const LinkRun& run : program.link_runs) {
      for (std::uint32_t i = run.first; run.scheme != Scheme::plain && i < run.first + run.count;
           ++i) {
        use(run, program.ends[i]);
      }
    }
  };
  const auto moves = [&](std::uint32_t node) {
    return node < program.moving || (!program.taps.empty() && node >= program.taps[0].node);
  };
  each([&](const LinkRun&, Ends ends) {
    for (const std::uint32_t end : {ends.a, ends.b}) {
      holders[end] = static_cast<std::uint8_t>(std::min(2, holders[end] + (moves(end) ? 1 : 0)));
    }
  });
  double sum = 0.0;
  each([&](const LinkRun& run, Ends ends) {
    const bool is_shared = std::max(holders[ends.a], holders[ends.b]) > 1;
    sum += facts_of(run.law).solve_operations + (is_shared ? of_a_shared_link : 0.0);
  });
  return sum;
}

double packs_of(const Workload& load) {
  const double lanes = static_cast<double>(vector_bytes(load.isa)) / bytes_of_number(load);
  return std::ceil(load.voices / lanes);
}

namespace {

// A sweep that does not fit has evicted most of its data before it starts again.
double lines_beyond(double cache, double bytes) {
  return std::clamp(2.0 * (bytes - cache), 0.0, bytes) / 64.0;
}

}  // namespace

double lines_of(double bytes) {
  return lines_beyond(48.0 * 1024.0, bytes);
}

double far_lines_of(double bytes) {
  return lines_beyond(2.0 * 1024.0 * 1024.0, bytes);
}

namespace {

double modes_under_places(const Program& program) {
  double modes = 0.0;
  for (const TapSlot& tap : program.taps) {
    modes += tap.is_on_body() ? 2.0 * tap.length : 0.0;
  }
  return modes;
}

}  // namespace

double worst_steps(const Program& program) {
  constexpr double of_a_point = 10.0;
  constexpr double of_an_audio_coefficient = 20.0;
  constexpr double of_a_solved_link = 400.0;
  double steps = program.moving + static_cast<double>(program.ends.size()) +
                 of_a_point * static_cast<double>(program.taps.size()) +
                 modes_under_places(program) +
                 of_an_audio_coefficient * static_cast<double>(program.audio_coefficients.size());
  steps += of_a_point * static_cast<double>(program.waveguides.size() + program.junctions.size());
  for (const LinkRun& run : program.link_runs) {
    steps += run.scheme == Scheme::plain ? 0.0 : of_a_solved_link * run.count;
  }
  return steps;
}

std::uint64_t node_bytes(const Program& program, std::uint64_t number_bytes) {
  return number_bytes * (numbers_of_node * program.position.size() +
                         numbers_of_coefficient * program.coefficients.size());
}

std::uint64_t bytes_with_shared_links(const Program& program, std::uint64_t number_bytes) {
  return node_bytes(program, number_bytes) + number_bytes * numbers_of_link * program.ends.size();
}

std::uint64_t bytes_with_own_links(const Program& program, std::size_t links,
                                   std::uint64_t number_bytes) {
  return node_bytes(program, number_bytes) + bytes_of_link * links;
}

std::string count_of(std::size_t count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

}  // namespace ressort::kernels
