// core: formats a number with printf's notation.
#pragma once

#include <cstdio>
#include <string>

namespace ressort {

// `form` has one conversion of a double, such as "%.3g Hz", and makes at most 63 characters.
inline std::string formatted(const char* form, double value) {
  char text[64];
  std::snprintf(text, sizeof text, form, value);
  return text;
}

}  // namespace ressort
