// core: the floating-point format of the kernels' numbers.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace ressort {

enum class Precision : std::uint8_t { float32, float64 };

constexpr const char* precision_name(Precision precision) {
  return precision == Precision::float64 ? "double" : "float";
}

constexpr std::optional<Precision> precision_named(std::string_view name) {
  for (const Precision precision : {Precision::float32, Precision::float64}) {
    if (name == precision_name(precision)) {
      return precision;
    }
  }
  return std::nullopt;
}

}  // namespace ressort
