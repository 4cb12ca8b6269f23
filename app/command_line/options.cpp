#include "app/command_line/options.h"

#include <string>

#include "core/model/language/expression.h"

namespace ressort::command_line {

CLI::Validator within(double least, double most) {
  const std::string range = print_number(least) + " to " + print_number(most);
  return {[=](std::string& text) {
            double number = 0.0;
            return parse_number(text, number) && number >= least && number <= most
                       ? std::string()
                       : "must be " + range + ", found " + text;
          },
          range};
}

void add_overwrite(CLI::App& command, bool& force) {
  command.add_flag("--force", force, "write over a file that is there");
}

Result<Setting> parse_setting(const std::string& text) {
  const std::size_t equals = text.find('=');
  Setting setting{text.substr(0, equals), 0.0};
  return equals != text.npos && equals > 0 && parse_number(text.substr(equals + 1), setting.value)
             ? Result<Setting>(setting)
             : Error{"expected NAME=VALUE, found '" + text + "'"};
}

void add_settings(CLI::App& command, std::vector<Setting>& settings) {
  add_parsed(command, "--set", settings, parse_setting, "NAME=VALUE, a parameter from the start");
}

void add_motion(CLI::App& command, std::optional<ThirdArgument>& third) {
  command
      .add_option_function<std::string>(
          "--motion",
          [&third](const std::string& word) {
            third = word == "velocity" ? ThirdArgument::velocity_per_second
                                       : ThirdArgument::delayed_position;
          },
          "what the last argument of a mass means: velocity, in units per second, or delayed, the\n"
          "position one sample before; without it, what the preset or the model says or shows")
      ->check(CLI::IsMember({"velocity", "delayed"}))
      ->type_name("WORD");
}

void add_method(CLI::App& command, std::optional<Method>& method) {
  std::vector<std::string> words = {"auto"};
  for (const auto use : {KernelRow::Use::published, KernelRow::Use::physical}) {
    for (const Method known : methods_for(use)) {
      words.emplace_back(method_name(known));
    }
  }
  command
      .add_option_function<std::string>(
          "--method", [&method](const std::string& word) { method = method_called(word); },
          "how each part is computed, where it can be: auto takes what is fastest, but for a\n"
          "bare model direct, which is the published scheme bit for bit on every machine")
      ->check([](const std::string& word) { return removed_method_advice(word); })
      ->check(CLI::IsMember(words))
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
          "how far the sound may be from the continuous network, and what may be left out:\n"
          "'cents=3 t60=5 silence=-60 passive=auto'; cents of pitch, % of decay, dB below the\n"
          "peak of the unreduced output over its whole life, and whether contacts may not gain\n"
          "energy: auto, always, never. Without it what the preset says, else the published\n"
          "scheme for all that is linear. Cents and % that cannot be kept are told, with how far\n"
          "off it is")
      ->type_name("TEXT");
}

void add_strict(CLI::App& command, bool& is_strict) {
  command.add_flag(
      "--strict", is_strict,
      "a budget of cents or t60 that is not kept, or of which nobody knows whether it\n"
      "is, and a bow that is too strong for its steps are errors: exit code 2 instead of\n"
      "a warning");
}

void add_numbers(CLI::App& command, Precision& precision, bool& rescale) {
  add_choice<Precision>(command, "--precision", precision,
                        {{"double", Precision::float64}, {"float", Precision::float32}},
                        "of the computation");
  command.add_flag_callback(
      "--no-rescale", [&rescale] { rescale = false; },
      "take the model's numbers raw at rates other than 44100 Hz");
}

void add_keys(CLI::App& command, KeyOptions& keys) {
  command.add_option("--tuning", keys.scale, "a Scala file, NAME.scl: the steps between keys");
  command.add_option("--keyboard-map", keys.keyboard_map,
                     "a Scala keyboard map, NAME.kbm: which key plays which step, at what pitch");
  command
      .add_option_function<double>(
          "--a4", [&keys](const double& hz) { keys.a4_hz = hz; },
          "the pitch of the A above the middle C, to which all is tuned (440)")
      ->check(within(220.0, 880.0));
}

void add_force(CLI::App& command, bool& force) {
  command.add_flag("--force", force,
                   "play a model that is not stable all the same; what runs away fades out");
}

}  // namespace ressort::command_line
