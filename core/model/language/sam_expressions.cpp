// Evaluates FAUST expressions: arithmetic, sliders, definitions, and `signal : function`.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/model/language/expression.h"
#include "core/model/language/sam_lines.h"

namespace ressort::model {
namespace {

// A function of numbers: the text around its first argument and behind its second.
struct NumberFunction {
  std::string_view name;
  std::size_t count = 1;
  std::string_view before;
  std::string_view behind = ")";
};
constexpr NumberFunction number_functions[] = {
    {"sqrt", 1, "sqrt("},
    {"abs", 1, "abs("},
    {"sin", 1, "sin("},
    {"cos", 1, "cos("},
    {"exp", 1, "exp("},
    {"pow", 2, "pow("},
    {"min", 2, "min("},
    {"max", 2, "max("},
    {"int", 1, "("},  // a number that a slider rounds already
    {"float", 1, "("},
    {"db2linear", 1, "pow(10,(", ")/20)"},
    {"mtof", 1, "440*pow(2,((", ")-69)/12)"},
    {"simpleStringTermDelay", 1, "0.5/(", ")"},
    {"tau2pole", 1, "exp(-1/44100/(", "))"},
};
constexpr std::string_view slider_words[] = {"hslider", "vslider", "nentry"};
// Filters that are left out and leave a constant as it is. Parameters that set levels move smoothly
// by themselves.
constexpr std::string_view smoothers[] = {"onePoleBLT", "lowpass3e", "lowpass6e"};
constexpr double highest_order = 6.0;
constexpr std::string_view sample_rate = "44100";

template <class List, class Item>
bool is_in(const List& list, const Item& item) {
  return std::ranges::find(list, item) != std::end(list);
}

const NumberFunction* function_of(std::string_view name) {
  const auto* const found = std::ranges::find(number_functions, name, &NumberFunction::name);
  return found == std::end(number_functions) ? nullptr : found;
}

std::string_view constant_of(std::string_view name) {
  return name == "fs" || name == "SR" ? sample_rate : name == "PI" ? "3.141592653589793" : "";
}

SamSignals number_signal(std::string number) {
  return {{.parts = {}, .number = std::move(number)}};
}

bool is_single_number(const std::optional<SamSignals>& value) {
  return value && value->size() == 1 && value->front().is_number();
}

}  // namespace

// A position in an expression, with the names and the input signals that hold there.
struct SamLines::Cursor {
  const Origin* line = nullptr;
  Token rest;
  std::string_view name;                                          // of the definition or the output
  const SamSignals* input = nullptr;                              // signals before the ':'
  const std::map<std::string_view, SamSignals>* scope = nullptr;  // arguments of a definition
  int depth = 0;

  void skip(std::size_t count) { rest = trimmed(behind(rest, count)); }
  bool starts(std::string_view text) const { return rest.text.starts_with(text); }
};

bool SamLines::is_reserved(std::string_view name) {
  return name == "fs" || name == "PI" || name == "clamp" ||
         (function_of(name) != nullptr && name != "mtof" && name != "db2linear");
}

std::nullopt_t SamLines::refuse(const Cursor& at, std::string message) {
  error(*at.line, {at.rest.text.substr(0, 1), at.rest.column}, std::move(message));
  return std::nullopt;
}

// Evaluates the definitions with sliders, so that the parameters are in the order of the text.
void SamLines::define_parameters() {
  for (const std::string& name : order_) {
    const SamDefinition& line = lines_.find(name)->second;
    const std::string_view text = line.expression.text;
    if (line.arguments.empty() && std::ranges::any_of(slider_words, [&](std::string_view word) {
          return text.find(word) != text.npos;
        })) {
      expression(line.origin, {name, line.origin.column});
    }
  }
}

std::string SamLines::expression(const Origin& line, const Token& token) {
  const SamSources* const sources = std::exchange(sources_, nullptr);
  Cursor at{.line = &line, .rest = trimmed(token), .name = "slider"};
  const Value value = chain(at);
  sources_ = sources;
  if (!value) {
    return "0";
  }
  if (!at.rest.text.empty() || !is_single_number(value)) {
    refuse(at, at.rest.text.empty() ? "expected one number"
                                    : "found " + quoted(at.rest.text) +
                                          " in a number; other FAUST code is not supported");
    return "0";
  }
  return value->front().number;
}

std::optional<SamSignal> SamLines::signal(const Origin& line, const Token& token,
                                          std::string_view name, const SamSources& sources) {
  sources_ = &sources;
  Cursor at{.line = &line, .rest = trimmed(token), .name = name};
  const Value value = chain(at);
  sources_ = nullptr;
  if (!value) {
    return std::nullopt;
  }
  if (!at.rest.text.empty() || value->size() != 1) {
    return refuse(at, at.rest.text.empty()
                          ? "expected one signal"
                          : "found " + quoted(at.rest.text) + " where ';' was expected");
  }
  return value->front();
}

// Evaluates a : b : c. Each part has the value before it as its input. `a <: (b,c)` is the same.
SamLines::Value SamLines::chain(Cursor& at, bool in_list) {
  Value value = in_list ? list(at) : sum(at);
  while (value && (at.starts(":") || at.starts("<:"))) {
    if (at.starts(":>")) {
      return refuse(at, "':>' is not supported");
    }
    Cursor next = at;
    next.skip(at.starts(":") ? 1 : 2);
    next.input = &*value;
    Value after = in_list ? list(next) : sum(next);
    at.rest = next.rest;
    value = std::move(after);
  }
  return value;
}

SamLines::Value SamLines::list(Cursor& at) {
  Value all = sum(at);
  while (all && at.starts(",")) {
    at.skip(1);
    Value next = sum(at);
    if (!next) {
      return next;
    }
    all->insert(all->end(), next->begin(), next->end());
  }
  return all;
}

// Reads operands with one of two signs between them, from left to right.
SamLines::Value SamLines::joined(Cursor& at, const char* one, const char* other,
                                 Value (SamLines::*operand)(Cursor&)) {
  Value all = (this->*operand)(at);
  while (all && (at.starts(one) || at.starts(other))) {
    const Token sign{at.rest.text.substr(0, 1), at.rest.column};
    at.skip(1);
    all = combined(at, sign, all, (this->*operand)(at));
  }
  return all;
}

SamLines::Value SamLines::sum(Cursor& at) {
  return joined(at, "+", "-", &SamLines::product);
}

SamLines::Value SamLines::product(Cursor& at) {
  return joined(at, "*", "/", &SamLines::power);
}

SamLines::Value SamLines::power(Cursor& at) {
  Value base = primary(at);
  if (!base || !at.starts("^")) {
    return base;
  }
  const Token sign{at.rest.text.substr(0, 1), at.rest.column};
  at.skip(1);
  return combined(at, sign, base, power(at));
}

// Returns left sign right, with the sign + - * / or ^. Only numbers multiply, divide and raise.
SamLines::Value SamLines::combined(const Cursor& at, const Token& sign, const Value& left,
                                   const Value& right) {
  if (!left || !right) {
    return std::nullopt;
  }
  if (left->size() != 1 || right->size() != 1) {
    error(*at.line, sign, "expected one signal on each side of " + quoted(sign.text));
    return std::nullopt;
  }
  const char op = sign.text[0];
  const SamSignal* a = &left->front();
  const SamSignal* b = &right->front();
  const auto joined = [&](const std::string& x, const std::string& y) {
    return join(*at.line, sign, x, op, y);
  };
  SamSignal result;
  if (op == '+' || op == '-') {
    result = *a;
    const bool is_known = b->number == "0" || a->number == "0";
    result.number = is_known && op == '+' ? (a->number == "0" ? b->number : a->number)
                    : b->number == "0"    ? a->number
                                          : joined(a->number, b->number);
    for (SamSignal::Part part : b->parts) {
      if (op == '-') {
        part.level = joined("0", part.level);
      }
      result.parts.push_back(std::move(part));
    }
    return SamSignals{std::move(result)};
  }
  if (op == '*' && a->is_number()) {
    std::swap(a, b);
  }
  if (!b->is_number() || (op == '^' && !a->is_number())) {
    error(*at.line, sign, "a signal may be multiplied by numbers, not by another signal");
    return std::nullopt;
  }
  result.number = a->number == "0" && !a->is_number() ? "0" : joined(a->number, b->number);
  for (SamSignal::Part part : a->parts) {
    part.level = joined(part.level, b->number);
    result.parts.push_back(std::move(part));
  }
  return SamSignals{std::move(result)};
}

SamLines::Value SamLines::primary(Cursor& at) {
  if (at.depth >= deepest_expression) {
    return refuse(at, "the parentheses, signs or definitions are nested too deeply");
  }
  Cursor inner = at;
  ++inner.depth;
  const auto back = [&](Value value) {
    at.rest = inner.rest;
    return value;
  };
  if (at.starts("(")) {
    inner.skip(1);
    Value value = chain(inner);
    if (value && !inner.starts(")")) {
      return refuse(inner, "expected ')'");
    }
    inner.skip(value ? 1 : 0);
    return back(std::move(value));
  }
  if (!at.rest.text.empty() && is_in(std::string_view("+-*/"), at.rest.text[0])) {
    const Token sign{at.rest.text.substr(0, 1), at.rest.column};
    inner.skip(1);
    if (at.input != nullptr && inner.starts("(")) {  // x : *(y) is x*y
      return back(combined(at, sign, *at.input, primary(inner)));
    }
    if (sign.text == "+" || sign.text == "-") {
      const Value value = primary(inner);
      return back(
          combined(at, {"*", sign.column}, value, number_signal(sign.text == "-" ? "-1" : "1")));
    }
  }
  if (!at.rest.text.empty() && is_in(std::string_view("0123456789."), at.rest.text[0])) {
    const std::size_t length = number_length(at.rest.text);
    const std::string number = tidy(*at.line, at.rest, std::string(at.rest.text.substr(0, length)));
    at.skip(length);
    return number_signal(number);
  }
  return word(at);
}

SamLines::Value SamLines::word(Cursor& at) {
  Token name{at.rest.text.substr(0, word_length(at.rest.text)), at.rest.column};
  if (name.text.empty()) {
    return refuse(at, "expected a number, a slider or the name of an element");
  }
  if (spent_ += 16; spent_ > max_model_bytes) {
    return refuse(at, "with all definitions inserted, this expression is too long");
  }
  at.skip(name.text.size());
  if (at.starts(".") && word_length(behind(at.rest, 1).text) > 0) {  // the name of a library
    at.skip(1);
    name = {at.rest.text.substr(0, word_length(at.rest.text)), at.rest.column};
    at.skip(name.text.size());
  }
  if (name.text == "_" && at.input != nullptr) {
    return *at.input;
  }
  if (at.scope != nullptr) {
    if (const auto found = at.scope->find(name.text); found != at.scope->end()) {
      return found->second;
    }
  }
  const auto definition = lines_.find(name.text);
  const bool is_known_table = name.text == "rdtable" && at.starts("(");
  if (is_known_table) {
    return table(at, name);
  }
  if (is_in(slider_words, name.text) && at.starts("(")) {
    return slider(at, name);
  }
  if (definition == lines_.end()) {
    if (const std::string_view constant = constant_of(name.text); !constant.empty()) {
      return number_signal(std::string(constant));
    }
  }
  std::vector<SamSignals> arguments;
  if (at.starts("(")) {
    auto given = arguments_of(at);
    if (!given) {
      return std::nullopt;
    }
    arguments = std::move(*given);
  }
  return definition != lines_.end() ? defined(at, name, std::move(arguments))
                                    : call(at, name, std::move(arguments));
}

std::optional<std::vector<SamSignals>> SamLines::arguments_of(Cursor& at) {
  std::vector<SamSignals> arguments;
  Cursor inner = at;
  inner.input = nullptr;
  ++inner.depth;
  do {
    inner.skip(1);
    Value value = chain(inner, false);
    if (!value) {
      return std::nullopt;
    }
    arguments.push_back(std::move(*value));
  } while (inner.starts(","));
  if (!inner.starts(")")) {
    return refuse(inner, "expected ')'");
  }
  inner.skip(1);
  at.rest = inner.rest;
  return arguments;
}

// Evaluates a definition with its arguments, or with the input if it names none.
SamLines::Value SamLines::defined(Cursor& at, const Token& name,
                                  std::vector<SamSignals> arguments) {
  SamDefinition& line = lines_.find(name.text)->second;
  if (line.is_open || at.depth >= deepest_expression) {
    error(*at.line, name,
          quoted(name.text) + (line.is_open ? " is defined in terms of itself"
                                            : " depends on more than 50 definitions in a row"));
    return std::nullopt;
  }
  if (at.input == nullptr && arguments.empty() && line.value) {
    return *line.value;
  }
  std::map<std::string_view, SamSignals> scope;
  SamSignals input;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (i < line.arguments.size()) {
      scope[line.arguments[i].text] = std::move(arguments[i]);
    } else {
      input.insert(input.end(), arguments[i].begin(), arguments[i].end());
    }
  }
  if (scope.size() < line.arguments.size()) {
    error(*at.line, name, "expected " + std::to_string(line.arguments.size()) + " arguments");
    return std::nullopt;
  }
  Cursor inner{.line = &line.origin,
               .rest = line.expression,
               .name = name.text,
               .input = input.empty() ? at.input : &input,
               .scope = &scope,
               .depth = at.depth + 1};
  line.is_open = true;
  Value value = chain(inner);
  line.is_open = false;
  if (value && !inner.rest.text.empty()) {
    return refuse(inner, "found " + quoted(inner.rest.text.substr(0, 1)) +
                             " in an expression; this FAUST code is not supported");
  }
  if (inner.input == nullptr && scope.empty()) {
    line.value = value ? value : number_signal("0");  // an error is reported once
  }
  return value;
}

// Evaluates a function of FAUST's libraries, or an element.
SamLines::Value SamLines::call(Cursor& at, const Token& name, std::vector<SamSignals> arguments) {
  const NumberFunction* const function = function_of(name.text);
  if (function != nullptr && arguments.empty() && at.input != nullptr) {
    for (const SamSignal& signal : *at.input) {
      arguments.push_back({signal});
    }
  }
  if (function != nullptr) {
    if (arguments.size() != function->count ||
        !std::ranges::all_of(arguments,
                             [](const SamSignals& value) { return is_single_number(value); })) {
      error(*at.line, name, quoted(name.text) + " is supported for numbers only");
      return std::nullopt;
    }
    std::string text = std::string(function->before) + arguments[0][0].number;
    text += function->count == 2 ? "," + arguments[1][0].number : "";
    return number_signal(tidy(*at.line, name, text + std::string(function->behind)));
  }
  if (at.input != nullptr) {  // a filter or another effect
    const std::vector<SamFilter> chain = filters(at, name, arguments);
    std::optional<SamSignal> signal = at.input->front();
    for (const SamFilter& filter : chain) {
      signal = signal ? filtered(at, name, *signal, filter) : signal;
    }
    if (!chain.empty() && signal) {
      return SamSignals{std::move(*signal)};
    }
    if (!is_single_number(*at.input) || !is_in(smoothers, name.text)) {
      if (left_out_.insert(std::string(name.text)).second) {
        warning(*at.line, name,
                "left out: " + quoted(name.text) +
                    (chain.empty() ? " is not supported"
                                   : " follows positions only, and at most three in a row"));
      }
    }
    return *at.input;
  }
  if (sources_ != nullptr && arguments.empty()) {
    const auto heard = sources_->heard(name);
    return heard ? Value(SamSignals{*heard}) : std::nullopt;
  }
  error(*at.line, name,
        "found " + quoted(name.text) +
            " where a number, a slider or a constant was expected; other FAUST code is not "
            "supported" +
            suggestion(name.text, parameters));
  return std::nullopt;
}

// Returns the sections of a filter of FAUST's libraries, or none for other functions. lowpass and
// highpass are Butterworth filters by the bilinear transform.
std::vector<SamFilter> SamLines::filters(const Cursor& at, const Token& name,
                                         const std::vector<SamSignals>& arguments) {
  const bool is_pass = name.text == "lowpass" || name.text == "highpass";
  const std::size_t count = is_pass ? 2 : name.text == "smooth" ? 1 : 0;
  if ((count == 0 && name.text != "smoo" && name.text != "dcblocker") || at.input->size() != 1 ||
      arguments.size() != count || !std::ranges::all_of(arguments, [](const SamSignals& value) {
        return is_single_number(value);
      })) {
    return {};
  }
  const auto is = [&](const std::string& text) { return tidy(*at.line, name, text); };
  if (!is_pass) {
    if (name.text == "dcblocker") {
      return {{.stiffness = "0.005", .direct = "1", .gain = "0"}};
    }
    const std::string share = count == 1 ? is("1-(" + arguments[0][0].number + ")") : "0.001";
    return {{.stiffness = share, .direct = share}};
  }
  double order = 0.0;
  const std::string& hz = arguments[1][0].number;
  if (!parse_number(arguments[0][0].number, order) || order != std::floor(order) || order < 1.0 ||
      order > highest_order || !(value(hz) > 0.0 && value(hz) < 22050.0)) {
    return {};
  }
  const bool is_high = name.text == "highpass";
  const std::string angle = "(clamp(" + hz + ",0.01,22049)*3.141592653589793/44100)";
  const std::string c = "(" + is("cos" + angle + "/sin" + angle) + ")";
  const int n = static_cast<int>(order);
  std::vector<SamFilter> sections;
  for (int i = n; i > 0; i -= 2) {
    const bool is_single = i == 1;
    const std::string a =
        print_number(2.0 * std::cos(std::numbers::pi * (i - 1) / (2.0 * n))) + "*";
    const std::string top = !is_high ? "1" : is_single ? c : c + "*" + c;
    const std::string sum = "(1+" + (is_single ? c : a + c + "+" + c + "*" + c) + ")";
    sections.push_back({.stiffness = is((is_single ? "2/" : "4/") + sum),
                        .damping = is_single ? "1" : is("2*" + a + c + "/" + sum),
                        .direct = is(top + "/" + sum),
                        .gain = is_high ? "0" : "1",
                        .lead = is_single ? "0" : is(top + "*" + a + c + "/2/" + sum)});
  }
  return sections;
}

// Returns a signal behind a filter. A constant is as after a long time.
std::optional<SamSignal> SamLines::filtered(const Cursor& at, const Token& name,
                                            const SamSignal& input, const SamFilter& filter) {
  const auto times = [&](const std::string& a, const std::string& b) {
    return b == "1" ? a : a == "1" ? b : join(*at.line, name, a, '*', b);
  };
  SamSignal result{.parts = {}, .number = times(input.number, filter.gain)};
  const std::string slow = join(*at.line, name, filter.gain, '-', filter.direct);
  for (SamSignal::Part part : input.parts) {
    if (part.is_force || (part.derivative == 2 && filter.lead != "0")) {
      return std::nullopt;
    }
    const SamElement* const follower = sources_->follower(*part.element, filter);
    if (follower == nullptr) {
      return std::nullopt;
    }
    const std::string level = part.level;
    part.level = times(level, filter.direct);
    result.parts.push_back(part);
    part.element = follower;
    part.level = times(level, slow);
    result.parts.push_back(part);
    if (filter.lead != "0") {
      ++part.derivative;
      part.level = join(*at.line, name, "0", '-', times(level, filter.lead));
      result.parts.push_back(part);
    }
  }
  return result;
}

// Evaluates hslider("label", start, least, most, step), vslider or nentry: a parameter that is
// named after its definition.
SamLines::Value SamLines::slider(Cursor& at, const Token& word) {
  const std::size_t last = closing(at.rest.text);
  if (last == std::string_view::npos) {
    return refuse(at, "this ( is never closed");
  }
  const std::vector<Token> parts =
      divided({at.rest.text.substr(1, last - 1), at.rest.column + 1}, ',');
  at.skip(last + 1);
  const auto [found, is_new] = sliders_.try_emplace({at.line->line, word.column}, at.name);
  if (!is_new) {
    return number_signal(found->second);
  }
  Cursor start{.line = at.line,
               .rest = parts[std::min<std::size_t>(1, parts.size() - 1)],
               .name = at.name,
               .depth = at.depth + 1};
  const Token place = start.rest;
  const Value value = parts.size() == 5 && !place.text.empty() ? chain(start) : std::nullopt;
  if (parts.size() != 5 || place.text.empty() || (value && !is_single_number(value))) {
    error(*at.line, place,
          "expected " + std::string(word.text) + "(\"label\", start, least, most, step)");
  }
  std::string name(at.name);
  while (is_in(parameters, name) || (name != at.name && lines_.contains(name))) {
    name += "_";
  }
  found->second = name;
  if (parameters.size() >= most_parameters) {
    error(*at.line, word, "a model has at most " + std::to_string(most_parameters) + " sliders");
    return std::nullopt;
  }
  parameters.push_back(name);
  values.push_back(is_single_number(value) ? this->value(value->front().number) : 0.0);
  parameter_lines.push_back(*at.line);
  return number_signal(name);
}

// Evaluates rdtable(size, mytake(counter, size, list), index): the list at a number, and straight
// lines between its entries.
SamLines::Value SamLines::table(Cursor& at, const Token& name) {
  const std::size_t last = closing(at.rest.text);
  const std::vector<Token> parts =
      last == std::string_view::npos
          ? std::vector<Token>()
          : divided({at.rest.text.substr(1, last - 1), at.rest.column + 1}, ',');
  std::vector<Token> source;
  if (parts.size() == 3 && parts[1].text.starts_with("mytake(") && parts[1].text.ends_with(')')) {
    source = divided({parts[1].text.substr(7, parts[1].text.size() - 8), parts[1].column + 7}, ',');
  }
  if (source.size() != 3) {
    error(*at.line, name, "expected rdtable(size, mytake(counter, size, list), index)");
    return std::nullopt;
  }
  Cursor inner = at;
  at.skip(last + 1);
  ++inner.depth;
  inner.input = nullptr;
  inner.rest = source[2];
  const Value list = chain(inner);
  inner.rest = parts[2];
  const Value index = chain(inner);
  if (!list || !is_single_number(index)) {
    return list && index ? refuse(inner, "expected a number as the table's index") : std::nullopt;
  }
  return number_signal(entry(*at.line, name, *list, index->front().number));
}

// Returns straight lines through the numbers of a list, which bend at its entries.
std::string SamLines::entry(const Origin& line, const Token& token, const SamSignals& list,
                            const std::string& index) {
  std::vector<double> y;
  for (const SamSignal& signal : list) {
    double number = 0.0;
    if (!signal.is_number() || !parse_number(signal.number, number)) {
      error(line, token, "the entries of a table must be numbers");
      return "0";
    }
    y.push_back(number);
  }
  // Behind both ends the lines are level. Each bend adds half its change of slope times |x - i|.
  const std::size_t last = y.size() - 1;
  std::string text = print_number(0.5 * (y.front() + y.back()));
  for (std::size_t i = 0; i <= last; ++i) {
    const double before = i == 0 ? 0.0 : y[i] - y[i - 1];
    const double after = i == last ? 0.0 : y[i + 1] - y[i];
    if (after != before) {
      text += "+" + print_number(0.5 * (after - before)) + "*abs(" + index + "-" +
              std::to_string(i) + ")";
    }
  }
  const double least = *std::ranges::min_element(y);
  text = least < 0.0 ? text : "max(" + print_number(least) + "," + text + ")";  // rounding
  if (text.size() <= longest_expression && parse_expression(text, parameters)) {
    return tidy(line, token, text);
  }
  const double place = std::clamp(value(index), 0.0, static_cast<double>(last));
  return fixed(line, token, y[static_cast<std::size_t>(place + 0.5)]);
}

// Replaces an expression that is too long by its value at the start, with a warning.
std::string SamLines::fixed(const Origin& line, const Token& token, double value) {
  if (left_out_.insert(":").second) {
    warning(line, token,
            "some expressions are too long to follow their sliders and keep their start values");
  }
  return tidy(line, token, print_number(value));
}

std::string SamLines::join(const Origin& line, const Token& token, const std::string& a, char op,
                           const std::string& b) {
  const std::string text =
      op == '^' ? "pow(" + a + "," + b + ")" : "(" + a + ")" + op + "(" + b + ")";
  if (text.size() > longest_expression || parse_expression(text, parameters)) {
    return tidy(line, token, text);
  }
  const double x = value(a);
  const double y = value(b);
  return fixed(line, token,
               op == '+'   ? x + y
               : op == '-' ? x - y
               : op == '*' ? x * y
               : op == '/' ? x / y
                           : std::pow(x, y));
}

std::string SamLines::tidy(const Origin& line, const Token& token, const std::string& text) {
  spent_ += text.size();
  if (text.size() > longest_expression || spent_ > max_model_bytes) {
    error(line, token, "with all definitions inserted, this expression is too long");
    return "0";
  }
  const auto formula = parse_expression(text, parameters);
  if (!formula) {
    error(line, token, formula.error().message);
    return "0";
  }
  if (!is_constant(*formula)) {
    return print_expression(*formula, parameters);
  }
  const double number = evaluate(*formula, {});
  if (!std::isfinite(number)) {
    error(line, token, quoted(token.text) + " is not a finite number");
    return "0";
  }
  return print_number(number);
}

double SamLines::value(const std::string& text, double factor) const {
  const auto formula = parse_expression(text, parameters);
  std::vector<double> moved = values;
  for (double& number : moved) {
    number *= factor;
  }
  return formula ? evaluate(*formula, moved) : 0.0;
}

}  // namespace ressort::model
