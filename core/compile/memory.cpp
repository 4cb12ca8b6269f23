#include "core/compile/memory.h"

#include <algorithm>
#include <cstddef>

#include "core/kernels/registry.h"

namespace ressort {
namespace {

constexpr std::size_t reserve = 4;  // voices more, as the engine has for those it steals

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
