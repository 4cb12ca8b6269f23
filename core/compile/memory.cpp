#include "core/compile/memory.h"

#include <algorithm>
#include <cstddef>

#include "core/kernels/domains/sharded.h"

namespace ressort {
namespace {

constexpr std::size_t reserve = 4;            // voices more, as the engine has for those it steals
constexpr std::uint64_t numbers_of_node = 5;  // position, velocity, force, and a kernel's own
constexpr std::uint64_t numbers_of_link = 1;  // for all voices of a kernel that has many
constexpr std::uint64_t bytes_of_link = 48;   // in tables
constexpr std::uint64_t numbers_of_coefficient = 3;

// Of one voice.
std::uint64_t voice_bytes(const Program& program, std::uint64_t number_bytes);

struct Weigher {
  const Program& program;
  std::uint64_t number_bytes;

  std::uint64_t nodes() const {
    return number_bytes * (numbers_of_node * program.position.size() +
                           numbers_of_coefficient * program.coefficients.size());
  }
  // Where each voice has tables of its own, for links that are stepped one by one.
  std::uint64_t own(std::size_t links) const { return nodes() + bytes_of_link * links; }
  std::uint64_t shared() const {
    return nodes() + number_bytes * numbers_of_link * program.ends.size();
  }

  std::uint64_t operator()(const Direct&) const { return shared(); }
  std::uint64_t operator()(const Chorus&) const { return shared(); }
  std::uint64_t operator()(const Compensated&) const { return shared(); }
  std::uint64_t operator()(const Modes& form) const {
    const std::uint64_t rows = 18 + form.places.size() + form.outputs.size() + form.pushes.size() +
                               form.stiffness.size() + form.damping.size();
    return nodes() + number_bytes * rows * form.modes;
  }
  std::uint64_t operator()(const Shards& form) const {
    std::uint64_t bytes = 0;
    for (const Shard& shard : *form.shards) {
      bytes += voice_bytes(shard.program, number_bytes);
    }
    return bytes;
  }
  std::uint64_t operator()(const Slow& form) const {
    return voice_bytes(*form.fine, number_bytes) + voice_bytes(*form.coarse, number_bytes);
  }
  std::uint64_t operator()(const Chains& form) const { return own(form.links.size()); }
  std::uint64_t operator()(const Grid& form) const { return own(form.rest_ends.size()); }
  std::uint64_t operator()(const Dense&) const { return own(program.ends.size()); }
  std::uint64_t operator()(const Fourth&) const { return own(program.ends.size()); }
};

std::uint64_t voice_bytes(const Program& program, std::uint64_t number_bytes) {
  return std::visit(Weigher{program, number_bytes}, program.form);
}

}  // namespace

std::uint64_t engine_bytes(const Machine& machine, int voices, Precision precision) {
  const auto wanted = static_cast<std::size_t>(std::max(1, voices));
  const std::uint64_t number_bytes =
      precision == Precision::float32 ? sizeof(float) : sizeof(double);
  std::uint64_t bytes = 0;
  for (const Program& program : machine.parts) {
    bytes += voice_bytes(program, number_bytes);
  }
  return bytes * (wanted + std::min(wanted, reserve));
}

}  // namespace ressort
