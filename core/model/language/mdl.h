// core/model: the .mdl text and the Network.
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

// One thing to say about a text: where (both from 1), how many characters, and what was found and
// expected.
struct Diagnostic {
  Severity severity = Severity::error;
  int line = 0;
  int column = 0;
  int length = 1;
  std::string message;
};

struct ReadOptions {
  // What the third state argument means, whatever the text says or shows.
  std::optional<ThirdArgument> third;
  std::string_view third_by = "was asked for";  // how ParsedNetwork::motion says who chose it
  std::uint64_t most_nodes = max_macro_nodes;   // of all macros; no more than a billion
  Progress progress = {};  // of what it stops, the only diagnostic is `stopped`, without a line
};

struct ParsedNetwork {
  Network network;                      // canonical; complete only if ok()
  std::vector<Diagnostic> diagnostics;  // in the order of the lines
  std::optional<ThirdArgument> third;   // nothing: the meanings agree
  std::string motion;                   // the same for a person, and why
  bool ok() const;
};

// Reads a whole model; goes on after an error, so that every problem is told at once. Never
// throws; what it takes in memory is bounded by the text. A model may be at most
// `max_model_bytes` long. [any thread but audio]
ParsedNetwork parse_network(std::string_view text, const ReadOptions& options = {});

inline constexpr std::size_t max_model_bytes = std::size_t{32} << 20;
inline constexpr int max_channels = 64;  // of inputs, and of outputs

// "file:line:column: error: message".
std::string to_string(const Diagnostic& diagnostic, std::string_view file);

}  // namespace ressort::model
