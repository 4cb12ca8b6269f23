#include "app/command_line/options.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/model/language/expression.h"

namespace ressort::command_line {

namespace {

CLI::Validator numbers(double least, double most, bool are_whole) {
  const std::string range = print_number(least) + " to " + print_number(most);
  return {[=](std::string& text) {
            double number = 0.0;
            return parse_number(text, number) && number >= least && number <= most &&
                           (!are_whole || number == std::floor(number))
                       ? std::string()
                       : (are_whole ? "must be a whole number, " : "must be ") + range +
                             ", found " + text;
          },
          range};
}

}  // namespace

CLI::Validator within(double least, double most) {
  return numbers(least, most, false);
}

CLI::Validator whole(double least, double most) {
  return numbers(least, most, true);
}

CLI::Option* add_model(CLI::App& command, std::string& name, const std::string& help) {
  return command.add_option("MODEL", name, help)->type_name("NAME");
}

CLI::Option* add_output(CLI::App& command, std::string& path, const std::string& help) {
  return command.add_option("-o,--output", path, help)->type_name("FILE");
}

void add_rate(CLI::App& command, const std::string& name, double& rate_hz, double least,
              double most) {
  command.add_option(name, rate_hz, "sample rate")
      ->type_name("HZ")
      ->check(within(least, most))
      ->capture_default_str();
}

void add_overwrite(CLI::App& command, bool& force) {
  command.add_flag("--force", force, "overwrite existing files");
}

Result<Setting> parse_setting(const std::string& text) {
  const std::size_t equals = text.find('=');
  Setting setting{text.substr(0, equals), 0.0};
  return equals != text.npos && equals > 0 && parse_number(text.substr(equals + 1), setting.value)
             ? Result<Setting>(setting)
             : Error{"expected NAME=VALUE, found '" + text + "'"};
}

void add_settings(CLI::App& command, std::vector<Setting>& settings) {
  add_parsed(command, "--set", settings, parse_setting, "initial value of a parameter")
      ->type_name("NAME=VALUE");
}

void add_motion(CLI::App& command, std::optional<ThirdArgument>& third) {
  command
      .add_option_function<std::string>(
          "--motion",
          [&third](const std::string& word) {
            third = word == "velocity" ? ThirdArgument::velocity_per_second
                                       : ThirdArgument::delayed_position;
          },
          "last argument of a mass: velocity (per second) or delayed position")
      ->check(CLI::IsMember({"velocity", "delayed"}).description(""))
      ->type_name("WORD");
}

void add_method(CLI::App& command, std::optional<Method>& method) {
  std::vector<std::string> words = {"auto"};
  std::string all = "auto";
  for (const Method known : all_methods()) {
    words.emplace_back(method_name(known));
    all += ", " + words.back();
  }
  command
      .add_option_function<std::string>(
          "--method", [&method](const std::string& word) { method = method_named(word); },
          "method of computation: " + all)
      ->check(CLI::IsMember(words).description(""))
      ->type_name("WORD");
}

void add_budget(CLI::App& command, std::optional<Budget>& budget) {
  command
      .add_option_function<std::string>(
          "--budget",
          [&budget](const std::string& text) {
            const auto parsed = parse_budget(text);
            if (!parsed) {
              throw CLI::ValidationError("--budget", parsed.error().message);
            }
            budget = *parsed;
          },
          "accuracy, such as 'cents=3 t60=5 silence=-60 passive=auto' (default: the preset's)")
      ->type_name("TEXT");
}

void add_strict(CLI::App& command, bool& is_strict, const std::string& cases) {
  command.add_flag("--strict", is_strict, "fail (exit code 2) if " + cases);
}

void add_no_rescale(CLI::App& command, bool& rescale) {
  command.add_flag_callback(
      "--no-rescale", [&rescale] { rescale = false; },
      "do not convert the model's numbers from 44100 Hz to other rates");
}

void add_numbers(CLI::App& command, std::optional<Precision>& precision, bool& rescale) {
  command
      .add_option_function<std::string>(
          "--precision",
          [&precision](const std::string& word) { precision = precision_named(word); },
          "floating-point format: double, float (default: the preset's)")
      ->check(CLI::IsMember({"double", "float"}).description(""))
      ->type_name("WORD");
  add_no_rescale(command, rescale);
}

namespace {

// Adds a word N or FROM=TO.
void add_channel(KeyOptions& keys, const std::string& word) {
  const std::size_t sign = std::min(word.find('='), word.size());
  double from = 0.0;
  double to = 0.0;
  const auto is_channel = [](double number) {
    return number >= 1.0 && number <= 16.0 && number == std::floor(number);
  };
  if (!parse_number(word.substr(0, sign), from) || !is_channel(from) ||
      !parse_number(sign < word.size() ? word.substr(sign + 1) : word, to) || !is_channel(to)) {
    throw CLI::ValidationError("--channel", "must be 1 to 16, or FROM=TO, found " + word);
  }
  int& target = (*keys.song_channels)[static_cast<std::size_t>(from) - 1];
  if (target >= 0) {
    throw CLI::ValidationError("--channel", "names channel " + word.substr(0, sign) + " twice");
  }
  target = static_cast<int>(to) - 1;
  *keys.channels |= 1U << target;
}

}  // namespace

void add_keys(CLI::App& command, KeyOptions& keys) {
  command.add_option("--tuning", keys.scale, "Scala scale, NAME.scl")->type_name("FILE");
  command.add_option("--keyboard-map", keys.keyboard_map, "Scala keyboard map, NAME.kbm")
      ->type_name("FILE");
  command
      .add_option_function<double>(
          "--a4", [&keys](const double& hz) { keys.a4_hz = hz; }, "pitch of A4 (default 440)")
      ->type_name("HZ")
      ->check(within(220.0, 880.0));
  command
      .add_option_function<std::vector<std::string>>(
          "--channel",
          [&keys](const std::vector<std::string>& words) {
            keys.channels = 0;
            keys.song_channels.emplace().fill(-1);
            for (const std::string& word : words) {
              add_channel(keys, word);
            }
          },
          "MIDI channels to receive (default: the preset's); 3=1 plays channel 3 of a MIDI file on "
          "channel 1")
      ->type_name("N|FROM=TO,...")
      ->delimiter(',');
  command.add_option("--transpose", keys.transpose, "semitones added to every preset's keys")
      ->type_name("SEMITONES")
      ->check(within(-most_transpose, most_transpose));
}

void add_force(CLI::App& command, bool& force) {
  command.add_flag("--force", force, "play unstable models; diverging voices fade out");
}

}  // namespace ressort::command_line
