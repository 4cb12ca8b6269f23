// What stands in one line as a function of signals is evaluated once by FAUST; what is defined by
// names is evaluated wherever they are named, through all that they stand on, and is never done. So
// each stage is a function, and hands its numbers to the next.
#include "core/model/faust/faust_solution.h"

#include <algorithm>

#include "core/laws/laws.h"
#include "core/model/faust/faust_passive.h"
#include "core/model/faust/faust_words.h"

namespace ressort::model {
namespace {

using Symbols = std::vector<std::string>;

std::string numbered(const std::string& what, std::size_t i) {
  return what + std::to_string(i + 1);
}
std::string numbered(const std::string& what, std::size_t i, std::size_t j) {
  return numbered(what, i) + "_" + std::to_string(j + 1);
}

// A matrix that is eliminated from its first rows on: symbols, "" for 0.
class Elimination {
 public:
  // `unknown` is what the rows are solved for, `prefix` what its own names start with.
  Elimination(std::size_t count, std::string unknown, std::string prefix)
      : count_(count),
        a_(count * count),
        b_(count),
        unknown_(std::move(unknown)),
        prefix_(std::move(prefix)) {
    for (std::size_t i = 0; i < count; ++i) {
      b_[i] = numbered(prefix_ + "b", i);
    }
  }

  std::string& at(std::size_t i, std::size_t j) { return a_[i * count_ + j]; }
  const std::string& right(std::size_t i) const { return b_[i]; }

  // So many rows, out of all below them.
  std::string eliminate(std::size_t rows) {
    text_.clear();
    for (std::size_t k = 0; k < rows; ++k) {
      for (std::size_t i = k + 1; i < count_; ++i) {
        eliminate(k, i);
      }
    }
    return text_;
  }
  // The unknowns of these rows, once those behind them are known.
  std::string substitute(std::size_t rows) {
    text_.clear();
    for (std::size_t k = rows; k-- > 0;) {
      std::string sum = b_[k];
      for (std::size_t j = k + 1; j < count_; ++j) {
        sum += at(k, j).empty() ? "" : " - " + at(k, j) + "*" + numbered(unknown_, j);
      }
      define(numbered(unknown_, k), "(" + sum + ")/" + at(k, k));
    }
    return text_;
  }

 private:
  void eliminate(std::size_t k, std::size_t i) {
    if (at(i, k).empty()) {
      return;
    }
    const std::string share = define(numbered(prefix_ + "m", i, k), at(i, k) + "/" + at(k, k));
    for (std::size_t j = k + 1; j < count_; ++j) {
      if (!at(k, j).empty()) {
        const std::string old = at(i, j).empty() ? "0.0" : at(i, j);
        at(i, j) = define(numbered(prefix_ + "a", i, j) + "_" + std::to_string(k + 1),
                          old + " - " + share + "*" + at(k, j));
      }
    }
    b_[i] = define(numbered(prefix_ + "b", i, k), b_[i] + " - " + share + "*" + b_[k]);
  }
  std::string define(const std::string& name, const std::string& what) {
    text_ += "    " + name + " = " + what + ";\n";
    return name;
  }

  std::size_t count_;
  Symbols a_;
  Symbols b_;
  std::string unknown_;
  std::string prefix_;
  std::string text_;
};

class Solution {
 public:
  explicit Solution(const FaustLinks& links)
      : links_(links), count_(links.links.size()), springs_(links.springs) {
    for (std::size_t i = 0; i < count_; ++i) {
      const FaustLink& link = links.links[i];
      for (std::size_t k = 0; k < link.arguments.size(); ++k) {
        const bool waits =
            link.sets_out && count_ > 1 && facts_of(link.law).arguments[k].unit == Unit::stiffness;
        hand_over(numbered("p", i, k),
                  (waits ? "wait_" + link.name + "*" : "") + link.arguments[k]);
      }
      if (link.law != Law::spring) {
        hand_over(numbered("x", i) + ", " + numbered("y", i), "rest_" + link.name);
      }
      for (const char* const what : {"c", "e", "s"}) {
        hand_over(numbered(what, i), std::string(what) + "_" + link.name);
      }
      for (std::size_t j = 0; j <= i; ++j) {
        if (const std::string& coupling = links.couplings[i * count_ + j]; !coupling.empty()) {
          hand_over(numbered("t", i, j), coupling);
        }
      }
    }
  }

  std::string text() {
    // In the very first sample nothing pulls that is stretched and does not go further; a hill lets
    // go.
    for (const FaustLink& link : links_.links) {
      if (!link.sets_out || count_ == 1) {
        continue;
      }
      const std::string rises = "(" + flow(link.arguments, ", ", 6) + ", c_" + link.name +
                                ", 0.0 : gradient_" + std::string(facts_of(link.law).name) +
                                " : _, !)*s_" + link.name + " > 0.0";
      text_ += "  wait_" + link.name + " = " +
               (link.law == Law::pluck ? "1'" : "select2(1', " + rises + ", 1)") + ";\n";
    }
    text_ += "  joint_" + links_.links[0].name + " = " + flow(given_, ", ", 6) +
             " : held\n  with {\n    held(" + flow(names_, ", ", 6) + ") = ";
    if (links_.links[0].sets_out && count_ == 1) {
      text_ +=
          "select2(1', " + first_alone() + ", " + (springs_ == 1 ? "f1" : alone(0, "s1")) + ")";
    } else if (springs_ == count_) {
      text_ += all_forces();
    } else {
      text_ += reduced() + " : pulled";
    }
    text_ += "\n    with {\n" + spring_rows();
    if (springs_ < count_) {
      pull();
    } else {
      text_ += rows_.substitute(springs_);
    }
    return text_ + "    };\n  };\n";
  }

 private:
  void hand_over(const std::string& name, const std::string& what) {
    names_.push_back(name);
    given_.push_back(what);
  }
  std::string coupling(std::size_t i, std::size_t j) const {
    return links_.couplings[i * count_ + j].empty() ? ""
                                                    : numbered("t", std::max(i, j), std::min(i, j));
  }
  std::string arguments(std::size_t i) const {
    Symbols words;
    for (std::size_t k = 0; k < links_.links[i].arguments.size(); ++k) {
      words.push_back(numbered("p", i, k));
    }
    return flow(words, ", ", 6);
  }
  std::string law(const char* which, std::size_t i) const {
    return which + std::string(facts_of(links_.links[i].law).name);
  }
  void define(const std::string& name, const std::string& what) {
    text_ += "    " + name + " = " + what + ";\n";
  }
  std::string list(const std::string& what, std::size_t first, std::size_t count) const {
    Symbols words;
    for (std::size_t i = first; i < first + count; ++i) {
      words.push_back(numbered(what, i));
    }
    return flow(words, ", ", 6);
  }
  std::string all_forces() const { return list("f", 0, count_); }

  // f + S C f = S s + K c of springs, K (c + s/2) + Z s/2 being what they exert; s + C f = free of
  // the others. The springs are eliminated.
  std::string spring_rows() {
    std::string text;
    for (std::size_t i = 0; i < springs_; ++i) {
      const std::string half = numbered("h", i);
      text += "    " + half + " = 0.5*(" + numbered("p", i, 0) + " + 1'*" + numbered("p", i, 1) +
              ");  " + numbered("b", i) + " = " + numbered("p", i, 0) + "*" + numbered("c", i) +
              " + " + half + "*" + numbered("s", i) + ";\n";
    }
    for (std::size_t i = springs_; i < count_; ++i) {
      text += "    " + numbered("b", i) + " = " + numbered("s", i) + ";\n";
    }
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < count_; ++j) {
        const std::string by = coupling(i, j);
        if (by.empty() && i != j) {
          continue;
        }
        const std::string far = by.empty() ? "0.0" : by;
        rows_.at(i, j) = numbered("a", i, j);
        text += "    " + numbered("a", i, j) + " = " +
                (i < springs_ ? (i == j ? "1.0 + " : "") + numbered("h", i) + "*" + far : far) +
                ";\n";
      }
    }
    return text + rows_.eliminate(springs_);
  }

  // What is left of the others: their ways, and how they move each other.
  std::string reduced() {
    spring_rows();
    Symbols words;
    Symbols names;
    for (std::size_t i = springs_; i < count_; ++i) {
      words.push_back(rows_.right(i));
      names.push_back(numbered("u", i));
    }
    is_coupled_.assign(count_ * count_, false);
    for (std::size_t i = springs_; i < count_; ++i) {
      for (std::size_t j = springs_; j < count_; ++j) {
        if (!rows_.at(i, j).empty()) {
          is_coupled_[i * count_ + j] = true;
          words.push_back(rows_.at(i, j));
          names.push_back(numbered("h", i, j));
        }
      }
    }
    pulled_ = "pulled(" + flow(names, ", ", 6) + ")";
    rows_ = Elimination(count_, "f", "");
    return flow(words, ", ", 6);
  }
  // What others take from a link's way.
  std::string less(std::size_t i, const std::string& force, bool own) const {
    std::string sum;
    for (std::size_t j = springs_; j < count_; ++j) {
      if (is_coupled_[i * count_ + j] && (own || j != i)) {
        sum += " - " + numbered("h", i, j) + "*" + numbered(force, j);
      }
    }
    return sum;
  }
  std::string alone(std::size_t i, const std::string& way) const {
    const std::string gamma = links_.links[0].sets_out && count_ == 1
                                  ? (coupling(0, 0).empty() ? "0.0" : coupling(0, 0))
                                  : numbered("h", i, i);
    return "(" + arguments(i) + ", " + numbered("x", i) + ", " + numbered("y", i) + ", " +
           numbered("c", i) + ", " + numbered("e", i) + ", " + way + ", " + gamma + " : " +
           law("alone_", i) + ")";
  }
  std::string first_alone() const {
    return "first_alone(" + law("gradient_", 0) + "(" + arguments(0) + "), c1, e1, s1, " +
           (coupling(0, 0).empty() ? "0.0" : "t1_1") + ")";
  }

  void pull() {
    if (links_.links[0].sets_out && count_ == 1) {
      return;
    }
    const std::size_t curved = count_ - springs_;
    const std::string forces = list("f", springs_, curved);
    if (springs_ > 0) {
      define("all(" + forces + ")",
             all_forces() + " with {\n" + rows_.substitute(springs_) + "    }");
    }
    if (curved == 1) {
      define(pulled_, alone(springs_, numbered("u", springs_)) + (springs_ > 0 ? " : all" : ""));
      return;
    }
    std::string way;
    std::string start;
    for (std::size_t i = springs_; i < count_; ++i) {
      start += start.empty() ? "0.0" : ", 0.0";
      way += (way.empty() ? "" : ", ") + numbered("u", i) + less(i, "f", true);
    }
    // One after the other, twice; then Newton.
    std::string turns;
    for (int round = 0; round < 2; ++round) {
      for (std::size_t i = springs_; i < count_; ++i) {
        turns += " : " + numbered("turn", i);
      }
    }
    text_ += "    " + pulled_ + " = " + start + turns + " : ways : seq(i, " +
             std::to_string(faust_joint_newtons) + ", newton) : exerted" +
             (springs_ > 0 ? " : all" : "") + "\n    with {\n";
    for (std::size_t i = springs_; i < count_; ++i) {
      Symbols words;
      for (std::size_t j = springs_; j < count_; ++j) {
        words.push_back(j == i ? alone(i, numbered("u", i) + less(i, "f", false))
                               : numbered("f", j));
      }
      define(numbered("turn", i) + "(" + forces + ")", flow(words, ", ", 6));
    }
    define("ways(" + forces + ")", way);
    newton();
    text_ += "    };\n";
  }

  void newton() {
    const std::size_t curved = count_ - springs_;
    const std::string ends = list("w", springs_, curved);
    Symbols values, known, steps, forces;
    Elimination matrix(curved, "g", "n");
    std::string inner;
    for (std::size_t k = 0; k < curved; ++k) {
      const std::size_t i = springs_ + k;
      const std::string w = numbered("w", i);
      const std::string v = numbered("v", i);
      const std::string q = numbered("q", i);
      define(numbered("pull", i) + "(w)",
             arguments(i) + ", " + numbered("c", i) + ", w : " + law("gradient_", i) + " : +(" +
                 numbered("x", i) + " + " + numbered("y", i) + "*w), +(" + numbered("y", i) + ")");
      values.push_back(numbered("pull", i) + "(" + w + ")");
      known.push_back(v + ", " + numbered("d", i));
      steps.push_back(w + " + " + numbered("g", k));
      forces.push_back(v + " + " + q + "*" + numbered("g", k));
      // Where a hill falls so steeply that it snaps, no further than Newton may go.
      const std::string slope = numbered("d", i);
      inner += "    " + q + " = " +
               (is_coupled_[i * count_ + i]
                    ? "max(" + slope + ", (0.0 - 0.9)/max(" + numbered("h", i, i) + ", 1e-300))"
                    : slope) +
               ";  " + numbered("nb", k) + " = " + numbered("u", i) + " - " + w +
               less(i, "v", true) + ";\n";
      for (std::size_t l = 0; l < curved; ++l) {
        const std::size_t j = springs_ + l;
        if (l != k && !is_coupled_[i * count_ + j]) {
          continue;
        }
        const std::string by =
            is_coupled_[i * count_ + j] ? numbered("h", i, j) + "*" + numbered("q", j) : "0.0";
        matrix.at(k, l) = numbered("na", k, l);
        inner += "    " + numbered("na", k, l) + " = " + (l == k ? "1.0 + " : "") + by + ";\n";
      }
    }
    define("step(" + flow(known, ", ", 6) + ", " + ends + ")",
           flow(steps, ", ", 6) + ", " + flow(forces, ", ", 6) + "\n    with {\n" + inner +
               matrix.eliminate(curved) + matrix.substitute(curved) + "    }");
    Symbols first;
    Symbols last;
    for (std::size_t k = 0; k < 2 * curved; ++k) {
      first.push_back(k < curved ? "_" : "!");
      last.push_back(k < curved ? "!" : "_");
    }
    const std::string both = flow(values, ", ", 6) + ", " + ends + " : step : ";
    define("newton(" + ends + ")", both + flow(first, ", ", 6));
    define("exerted(" + ends + ")", both + flow(last, ", ", 6));
  }

  const FaustLinks& links_;
  std::size_t count_;
  std::size_t springs_;
  Symbols given_;
  Symbols names_;
  Elimination rows_{count_, "f", ""};
  std::string pulled_;            // the function of what is left of the others
  std::vector<bool> is_coupled_;  // [link][link] of those
  std::string text_;
};

}  // namespace

std::string faust_solution(const FaustLinks& links) {
  return Solution(links).text();
}

}  // namespace ressort::model
