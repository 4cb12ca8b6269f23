// app/command_line: the options of each command.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "app/commands/body/body.h"
#include "app/commands/chart/chart.h"
#include "app/commands/check.h"
#include "app/commands/commands.h"
#include "app/commands/export.h"
#include "app/commands/make.h"
#include "app/commands/modes/modes.h"
#include "app/commands/timbre/describe.h"
#include "app/commands/timbre/shape_model.h"

namespace ressort::command_line {

struct RenderChoice {
  RenderOptions options;
  bool all_presets = false;
  double seconds = 0.0;
  long long frames = 0;
  bool is_quiet = false;
};

struct MakeChoice {
  MakeOptions options;
  std::vector<std::uint32_t> sizes;
};

// Adds a command to the program. Parsing fills the options, runs the command and sets its exit
// code. The options and `code` must outlive `app`. [main]
void add_play(CLI::App& app, PlayOptions& options, int& code);
void add_render(CLI::App& app, RenderChoice& choice, int& code);
void add_check(CLI::App& app, CheckOptions& options, int& code);
void add_make(CLI::App& app, MakeChoice& choice, int& code);
void add_export(CLI::App& app, ExportOptions& options, int& code);
void add_modes(CLI::App& app, ModesOptions& options, int& code);
void add_describe(CLI::App& app, DescribeOptions& options, int& code);
void add_shape(CLI::App& app, ShapeOptions& options, int& code);
void add_body(CLI::App& app, BodyRequest& request, int& code);
void add_chart(CLI::App& app, ChartOptions& options, int& code);
void add_reference(CLI::App& app, std::string& part, int& code);

}  // namespace ressort::command_line
