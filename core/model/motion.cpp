// Decides the meaning of the third state argument: by option, by a line of the text, by its
// dialect, or by the states themselves.
#include "core/model/language/reader.h"

namespace ressort::model {
namespace {

constexpr ThirdArgument velocity = ThirdArgument::velocity_per_second;
constexpr ThirdArgument delayed = ThirdArgument::delayed_position;

std::string line_of(int number) {
  return "line " + std::to_string(number);
}

}  // namespace

void Reader::read_motion(const Line& line, const std::vector<Token>& tokens) {
  const bool is_velocity = tokens.size() == 2 && tokens[1].text == "velocity";
  if (!is_velocity && (tokens.size() != 2 || tokens[1].text != "delayed")) {
    return error(line, tokens.size() > 1 ? tokens[1] : tokens[0],
                 "expected '~motion velocity' or '~motion delayed'");
  }
  const ThirdArgument third = is_velocity ? velocity : delayed;
  if (said_ && *said_ != third) {
    return error(line, tokens[1], line_of(said_line_) + " says the opposite");
  }
  said_ = third;
  said_line_ = line.number;
}

void Reader::choose_motion(ThirdArgument third, const std::string& why) {
  out_.network.third = third;
  out_.third = third;
  out_.motion = (third == velocity ? "a velocity in units per second, as "
                                   : "the position one sample before, as ") +
                why;
}

void Reader::decide_motion(const ReadOptions& options) {
  Network& network = out_.network;
  if (options.third) {
    choose_motion(*options.third, std::string(options.third_by));
  } else if (said_) {
    choose_motion(*said_, line_of(said_line_) + " says");
  } else if (rests_at_zero(network)) {
    out_.motion = "both meanings agree: every mass starts at 0, at rest";
  } else if (velocity_.line > 0 || delayed_.line > 0) {
    decide_by_dialect();
  } else {
    decide_by_states();
  }
  for (const std::uint32_t macro : resting_) {
    network.macros[macro].third = network.third == velocity ? 0.0 : network.macros[macro].position;
  }
}

// If a text has features of both dialects, MIMS4Max wins, because it is still in use.
void Reader::decide_by_dialect() {
  if (velocity_.line == 0) {
    return choose_motion(
        delayed, line_of(delayed_.line) + " " + std::string(delayed_.what) + ", which is MIMS");
  }
  choose_motion(velocity, line_of(velocity_.line) + " " + std::string(velocity_.what) +
                              ", which is MIMS4Max");
  if (delayed_.line == 0) {
    return;
  }
  const auto doubt = [&](const auto& element) {
    report(Severity::warning, element.location.line, {element.name, element.location.column},
           "its motion is read as " + out_.motion + "; but " + line_of(delayed_.line) + " " +
               std::string(delayed_.what) +
               ", which is MIMS: add '~motion delayed' to read the "
               "motions as MIMS does, or '~motion velocity' to keep this reading");
  };
  for (const Mass& mass : out_.network.masses) {
    if (moves(mass) && mass.third != 0.0) {
      return doubt(mass);
    }
  }
  for (const Macro& macro : out_.network.macros) {
    if (macro.third != 0.0) {
      return doubt(macro);
    }
  }
}

// Rest away from 0 is written (x, x) in one meaning and (x, 0) in the other. (0, x) starts at 0
// with a velocity; read as a velocity per second it would be tiny, so it indicates a delayed
// position.
void Reader::decide_by_states() {
  Network& network = out_.network;
  const Mass* shows_delayed = nullptr;
  const Mass* shows_velocity = nullptr;
  for (const Mass& mass : network.masses) {
    const bool from_zero = mass.position == 0.0 || mass.third == mass.position;
    if (moves(mass) && mass.third != 0.0 && from_zero && shows_delayed == nullptr) {
      shows_delayed = &mass;
    }
    if (moves(mass) && mass.third == 0.0 && mass.position != 0.0 && shows_velocity == nullptr) {
      shows_velocity = &mass;
    }
  }
  if (shows_delayed == nullptr && shows_velocity == nullptr) {
    return choose_motion(delayed, "nothing indicates the other meaning");
  }
  if (shows_delayed == nullptr) {
    return choose_motion(
        velocity, line_of(shows_velocity->location.line) + " rests away from 0 with a motion of 0");
  }
  const bool is_rest = shows_delayed->position != 0.0;
  choose_motion(delayed,
                line_of(shows_delayed->location.line) +
                    (is_rest ? " rests with a motion equal to its position" : " starts from 0"));
  if (shows_velocity == nullptr) {
    return;
  }
  report(Severity::warning, shows_velocity->location.line,
         {shows_velocity->name, shows_velocity->location.column},
         "a motion of 0 is read as rest, although motions are " + out_.motion +
             "; add '~motion velocity' or '~motion delayed' to decide");
  for (Mass& mass : network.masses) {
    if (moves(mass) && mass.third == 0.0) {
      mass.third = mass.position;
    }
  }
}

}  // namespace ressort::model
