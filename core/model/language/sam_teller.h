// core/model: how Synth-A-Modeler's elements become lines of our language.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/expression.h"
#include "core/model/language/faust_lines.h"

namespace ressort::model {

enum class SamKind {
  mass,
  ground,
  port,
  resonators,
  link,
  touch,
  pluck,
  waveguide,
  termination,
  junction,
  audioout
};

struct SamShape {
  std::string_view word;
  SamKind kind{};
  int least = 0;  // arguments
  int most = 0;
  int names = 1;  // without labels
  std::string_view form;
};

inline bool is_link(SamKind kind) {
  return kind == SamKind::link || kind == SamKind::touch || kind == SamKind::pluck;
}

struct SamElement {
  const Statement* statement = nullptr;
  const SamShape* shape = nullptr;
  std::string end;                  // how a link of ours names it; empty if none may hold it
  std::string force;                // constant, towards -x; masses only
  std::vector<std::size_t> guides;  // that end here; terminations and junctions only
};

// What an audioout adds up: elements, each times an expression of ours ("": 1), or, where there are
// none, that expression alone.
struct SamHeard {
  struct Part {
    std::size_t element = 0;
    std::string level;
  };
  std::vector<Part> parts;
  std::string number;

  bool is_number() const { return parts.empty(); }
  // Puts each of its expressions between these.
  void wrap(const std::string& before, const std::string& behind) {
    for (Part& part : parts) {
      part.level = before + (part.level.empty() ? "1" : part.level) + behind;
    }
    number = before + number + behind;
  }
};

// Tells one text.
class SamTeller {
 public:
  ToldText tell(std::string_view text, const Progress& progress);

 private:
  void declare();
  bool declare(const Statement& statement);
  std::string label_of(const SamElement& element) const;
  void name_ends();
  void join_guides();
  void join_row(std::size_t termination);
  std::optional<std::string> period_of(const SamElement& guide);
  // What a termination takes of a wave: `gain` of all partials alike, and of each one besides
  // pi^2/6 (its frequency/fc)^2, as a running mean does well below its first zero.
  struct Loss {
    std::string flat;  // -ln of the reflection
    std::string fc;    // empty: no running mean
    bool is_free = false;
  };
  std::optional<Loss> loss_of(const SamElement& termination);
  void add_forces();
  void write(const SamElement& element);
  void write_resonators(const SamElement& element);
  std::string like(std::string_view name) const;
  void write_link(const SamElement& element);
  void write_output(const SamElement& element);
  std::optional<SamHeard> sum(const SamElement& out, Token& rest, int depth);
  std::optional<SamHeard> product(const SamElement& out, Token& rest, int depth);
  std::optional<SamHeard> factor(const SamElement& out, Token& rest, int depth);

  std::string number(const SamElement& element, std::size_t at) {
    return lines_.expression(element.statement->origin, element.statement->arguments[at]);
  }
  std::string scaled(const SamElement& element, std::size_t at, const std::string& factor) {
    return lines_.tidy(element.statement->origin, element.statement->arguments[at],
                       factor + "*(" + number(element, at) + ")");
  }
  // A number without parameters.
  std::string fixed(const SamElement& element, std::size_t at) {
    std::string text = number(element, at);
    double value = 0.0;
    if (!parse_number(text, value)) {
      error(element, element.statement->arguments[at],
            "a starting position, a speed and a height take numbers, not sliders");
    }
    return text;
  }
  void error(const SamElement& element, const Token& token, std::string message) {
    lines_.error(element.statement->origin, token, std::move(message));
  }
  void emit(const Origin& origin, const std::string& line) {
    if (out_.text.size() <= max_model_bytes) {  // else it is told where it is read
      out_.text += line + "\n";
      out_.origins.push_back(origin);
    }
  }

  FaustLines lines_;
  std::vector<SamElement> elements_;
  std::map<std::string_view, std::size_t> by_name_;
  std::vector<bool> joined_;  // [element]: a guide that a row has
  int ports_ = 0;
  int outputs_ = 0;
  ToldText out_;
};

}  // namespace ressort::model
