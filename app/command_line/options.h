// app/command_line: options that several commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/session/loader.h"
#include "core/compile/plan.h"
#include "core/compile/stability_check.h"
#include "core/model/network.h"
#include "core/ranges.h"
#include "core/result.h"

namespace ressort::command_line {

// Creates the options of a command, with the lifetime of the command. After parsing, run(options)
// sets the exit code.
template <class Options, class Run>
Options& run_with(CLI::App& command, int& code, Run run) {
  const auto options = std::make_shared<Options>();
  command.callback([options, run, &code] { code = run(*options); });
  return *options;
}

// Accepts numbers within a range; rejects NaN and words.
CLI::Validator within(double least, double most);
// Accepts whole numbers within a range.
CLI::Validator whole(double least, double most);

// The preset or model to load.
CLI::Option* add_model(CLI::App& command, std::string& name, const std::string& help);
CLI::Option* add_output(CLI::App& command, std::string& path, const std::string& help);
void add_rate(CLI::App& command, const std::string& name, double& rate_hz, double least,
              double most);

// Permission to replace existing files.
void add_overwrite(CLI::App& command, bool& force);

// Parses "NAME=VALUE", the initial value of a parameter.
Result<Setting> parse_setting(const std::string& text);
void add_settings(CLI::App& command, std::vector<Setting>& settings);

// The meaning of the last argument of a mass.
void add_motion(CLI::App& command, std::optional<ThirdArgument>& third);

void add_method(CLI::App& command, std::optional<Method>& method);
void add_budget(CLI::App& command, std::optional<Budget>& budget);
void add_strict(CLI::App& command, bool& is_strict, const std::string& cases);
void add_force(CLI::App& command, bool& force);

void add_no_rescale(CLI::App& command, bool& rescale);
// Precision and rescaling.
void add_numbers(CLI::App& command, std::optional<Precision>& precision, bool& rescale);

// Tuning, which overrides the preset.
void add_keys(CLI::App& command, KeyOptions& keys);

// An option that takes one of a few words. The first is the default.
template <class T>
CLI::Option* add_choice(CLI::App& command, const std::string& name, T& target,
                        const std::vector<std::pair<std::string, T>>& choices,
                        const std::string& help) {
  const std::string words = joined(choices, ", ", &std::pair<std::string, T>::first);
  return command
      .add_option_function<std::string>(
          name,
          [&target, choices, name, words](const std::string& text) {
            for (const auto& [word, value] : choices) {
              if (word == text) {
                target = value;
                return;
              }
            }
            throw CLI::ValidationError(name, "must be one of " + words + ", found " + text);
          },
          help + ": " + words + " (default " + choices.front().first + ")")
      ->type_name("WORD");
}

// An option that may be repeated; `parse` reads each value.
template <class T>
CLI::Option* add_parsed(CLI::App& command, const std::string& name, std::vector<T>& target,
                        Result<T> (*parse)(const std::string&), const std::string& help) {
  return command
      .add_option_function<std::vector<std::string>>(
          name,
          [&target, parse, name](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) {
              auto parsed = parse(text);
              if (!parsed) {
                throw CLI::ValidationError(name, parsed.error().message);
              }
              target.push_back(*parsed);
            }
          },
          help)
      ->type_name("TEXT")
      ->take_all()
      ->allow_extra_args(false);
}

}  // namespace ressort::command_line
