// app/command_line: options that several commands have.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/session/loader.h"
#include "core/compile/plan.h"
#include "core/compile/stability_check.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::command_line {

// A number within a range; what is no number is in none.
CLI::Validator within(double least, double most);

// Whether a file that is there is written over.
void add_overwrite(CLI::App& command, bool& force);

// "NAME=VALUE", what a parameter is from the start.
Result<Setting> parse_setting(const std::string& text);
void add_settings(CLI::App& command, std::vector<Setting>& settings);

// What the last argument of a mass means, for every command that reads a model.
void add_motion(CLI::App& command, std::optional<ThirdArgument>& third);

void add_method(CLI::App& command, std::optional<Method>& method);
void add_budget(CLI::App& command, std::optional<Budget>& budget);
void add_strict(CLI::App& command, bool& is_strict);
void add_force(CLI::App& command, bool& force);

// How the network is computed, for every command that computes it.
void add_numbers(CLI::App& command, Precision& precision, bool& rescale);

// What is said of keys, instead of what the preset says.
void add_keys(CLI::App& command, KeyOptions& keys);

// One of a few words.
template <class T>
CLI::Option* add_choice(CLI::App& command, const std::string& name, T& target,
                        const std::vector<std::pair<std::string, T>>& choices,
                        const std::string& help) {
  std::string words;
  for (const auto& [word, value] : choices) {
    words += (words.empty() ? "" : ", ") + word;
  }
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
          help + ": " + words + " (" + choices.front().first + ")")
      ->type_name("WORD");
}

// Texts that one function reads, one for each time that the option stands.
template <class T>
void add_parsed(CLI::App& command, const std::string& name, std::vector<T>& target,
                Result<T> (*parse)(const std::string&), const std::string& help) {
  command
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
