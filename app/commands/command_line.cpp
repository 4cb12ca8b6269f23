#include "app/commands/command_line.h"

#include <string>

#include "core/model/language/expression.h"

namespace ressort {

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

}  // namespace ressort
