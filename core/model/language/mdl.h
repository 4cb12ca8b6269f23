// core/model: reads the .mdl language.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/network.h"
#include "core/model/topology.h"
#include "core/progress.h"

namespace ressort::model {

enum class Severity { warning, error };

// A warning or an error. Line and column count from 1.
struct Diagnostic {
  Severity severity = Severity::error;
  int line = 0;
  int column = 0;
  int length = 1;
  std::string message;
};

struct ReadOptions {
  // Meaning of the third state argument; overrides the text.
  std::optional<ThirdArgument> third;
  std::string_view third_by = "requested";     // the reason in ParsedNetwork::motion
  std::uint64_t most_nodes = max_macro_nodes;  // limit for all macros together; at most a billion
  Progress progress =
      {};  // when it stops the reader, the only diagnostic is `stopped`, without a line
};

struct ParsedNetwork {
  Network network;                      // canonical; complete only if ok()
  std::vector<Diagnostic> diagnostics;  // in the order of the lines
  std::optional<ThirdArgument> third;   // empty: both meanings agree
  std::string motion;                   // the meaning in words, and the reason
  bool ok() const;
};

// Reads a whole model of at most `max_model_bytes`. Continues after an error, to report all of
// them. Never throws; the memory is proportional to the text. [any thread but audio]
ParsedNetwork parse_network(std::string_view text, const ReadOptions& options = {});

inline constexpr std::size_t max_model_bytes = std::size_t{32} << 20;
inline constexpr int max_channels = 64;  // limit for inputs and for outputs

// Returns "file:line:column: error: message".
std::string to_string(const Diagnostic& diagnostic, std::string_view file);

}  // namespace ressort::model
