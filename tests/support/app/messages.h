// tests: exact diagnostics of a text.
#pragma once

#include <string>
#include <vector>

#include "core/model/language/mdl.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::messages {

// Checks for exactly these diagnostics in this order; their lengths are ignored.
inline void check_told(const std::string& text, const std::vector<Diagnostic>& expected) {
  const std::vector<Diagnostic> found = parse_network(text).diagnostics;
  std::string all;
  for (const Diagnostic& diagnostic : found) {
    all += to_string(diagnostic, "model") + "\n";
  }
  INFO(text << "\n" << all);
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    CHECK(found[i].severity == expected[i].severity);
    CHECK(found[i].line == expected[i].line);
    CHECK(found[i].column == expected[i].column);
    CHECK(found[i].length >= 1);
    CHECK(found[i].message == expected[i].message);
  }
}

inline void check_error(const std::string& text, int line, int column, const std::string& message) {
  check_told(text, {{Severity::error, line, column, 1, message}});
}

inline void check_warning(const std::string& text, int line, int column,
                          const std::string& message) {
  check_told(text, {{Severity::warning, line, column, 1, message}});
}

}  // namespace ressort::messages
