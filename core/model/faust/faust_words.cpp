#include "core/model/faust/faust_words.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/faust/faust_passive.h"
#include "core/model/language/expression.h"

namespace ressort::model {
namespace {

constexpr std::size_t line_width = 100;

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

// Comparisons only choose, here and in the laws: where FAUST has to compute with them, its types
// take ten times as long to find.
constexpr FaustDefinition helpers[] = {
    {"swing",
     "swing(m, k, z, x0, v0, f) = step ~ (_, _)\n"
     "with {\n"
     "  step(x, v) = before + now, now with {\n"
     "    before = x + first(x0);\n"
     "    speed = v + first(v0);\n"
     "    now = speed + (f - spring(k, z, before, speed))/m;\n"
     "  };\n"
     "};\n"},
    // M, K and Z of a body's mode as they are stepped (core/sampled_mode.h)
    {"sampled",
     "sampled(m, k, z) = mass, mass*(ring + out*(1.0 - ring)), mass*(lost + out*(1.0 - lost))\n"
     "with {\n"
     "  stiff = k/m*r*r;\n"
     "  half = 0.5*z/m*r;\n"
     "  square = stiff - half*half;\n"
     "  root = 0.5*sqrt(abs(square));\n"
     "  decay = exp(0.0 - half);\n"
     "  sine = sin(root);\n"
     "  creep = exp(root) - exp(0.0 - root);\n"
     "  swing = select2(square > 0.0, 0.0 - 0.5*creep*creep, 2.0*sine*sine);\n"
     "  ring = (1.0 - decay)*(1.0 - decay) + 2.0*decay*swing;\n"
     "  lost = 1.0 - decay*decay;\n"
     "  out = max(0.0, min(1.0, (square - 8.2)/1.6));\n"
     "  mass = m*(1.0 + out*(stiff - 1.0));\n"
     "};\n"},
    // A waveguide's numbers (core/kernels/waveguides/design.h), at least so many samples long.
    {"guide",
     "guide(least, hz, t60, brightness) = samples, rate/f, allpass, pole, gain\n"
     "with {\n"
     "  rate = fconstant(int fSamplingFreq, <math.h>);\n"
     "  f = max(15.0, min(hz, rate/(least + 1.5)));\n"
     "  bright = max(0.0, min(1.0, brightness));\n"
     "  turn = 6.283185307179586;\n"
     "  theta = turn*f/rate;\n"
     "  decay = 6.907755278982137/(max(t60, 3.0/f)*rate);\n"
     "  loss = decay*rate/f;\n"
     "  abs2(a, b) = a*a + b*b;\n"
     "  over(a, b, x, y) = (a*x + b*y)/abs2(x, y), (b*x - a*y)/abs2(x, y);\n"
     "  less(a, b, x, y) = a - x, b - y;\n"
     "  // 1/z at the tone's pole z, and 1 - 1/z\n"
     "  re = exp(decay)*cos(theta);\n"
     "  im = 0.0 - exp(decay)*sin(theta);\n"
     "  rise = 2.0*exp(decay)*sin(0.5*theta)*sin(0.5*theta) - (exp(decay) - 1.0);\n"
     "  // ln of the loss's pole there, 1 - a being e^room\n"
     "  size(room) = 0.0 - 0.5*log(abs2(1.0 + x*rise, x*im)) with { x = exp(0.0 - room) - 1.0; };\n"
     "  angle(room) = atan2(x*im, 1.0 + x*rise) with { x = exp(0.0 - room) - 1.0; };\n"
     "  delay(room) = (turn + angle(room))/theta;\n"
     "  loud(room) = 0.0 - loss*bright + size(room) + decay*delay(room);\n"
     "  half(i, low) = select2(loud(middle) > 0.0, middle, low) with { middle = low + "
     "30.0/pow(2.0, i); };\n"
     "  found = 0.0 - 60.0 : seq(i, 12, half(i)) : seq(i, 3, nearer);\n"
     "  nearer(room) = room - loud(room)/(by_room(room) : _, *(decay/theta) : +);\n"
     "  wants = (bright < 1.0) & (loud(0.0) > 0.0);\n"
     "  fits = delay(found) >= least + 0.5;\n"
     "  is_dark = wants & fits;\n"
     "  first_room = select2(is_dark, 0.0, found);\n"
     "  log_gain = 0.0 - loss*select2(wants & (delay(found) < least + 0.5), bright, 1.0);\n"
     "  samples = max(least, floor(delay(first_room) - 0.500000001));\n"
     "  rest = (delay(first_room) - samples)*theta;\n"
     "  first_allpass = sin(0.5*(theta - rest))/sin(0.5*(theta + rest));\n"
     "  // ln of the loop, and how it grows with both filters\n"
     "  level(room, c) = log_gain + size(room) + 0.5*log(abs2(c + re, im)/abs2(1.0 + c*re, c*im)) "
     "+\n"
     "    samples*decay;\n"
     "  phase(room, c) = remainder(angle(room) + atan2(im, c + re) - atan2(c*im, 1.0 + c*re) -\n"
     "    samples*theta, turn);\n"
     "  by_room(room) = over(rise, 0.0 - im, e + (1.0 - e)*rise, 0.0 - (1.0 - e)*im) with { e = "
     "exp(room); };\n"
     "  by_allpass(c) = over(1.0, 0.0, c + re, im), over(re, im, 1.0 + c*re, c*im) : less;\n"
     "  newton(room, c) = level(room, c), phase(room, c), by_room(room), by_allpass(c) : step with "
     "{\n"
     "    step(x, y, a, b, c1, d) = room - (x*d - y*c1)/(a*d - b*c1), c - (a*y - b*x)/(a*d - "
     "b*c1);\n"
     "  };\n"
     "  both = found, first_allpass : seq(i, 3, newton);\n"
     "  dark_room = both : _, !;\n"
     "  dark_allpass = both : !, _;\n"
     "  is_solved = (dark_room <= 0.0) & (abs(dark_allpass) < 1.0);\n"
     "  alone(c) = c - phase(0.0, c)/(by_allpass(c) : !, _);\n"
     "  flat = first_allpass : seq(i, 3, alone);\n"
     "  pole = select2(is_dark, 0.0, 1.0 - exp(select2(is_solved, found, dark_room)));\n"
     "  allpass = select2(is_dark, flat, select2(is_solved, first_allpass, dark_allpass));\n"
     "  gain = min(1.0, exp(log_gain - select2(is_dark, level(0.0, flat), 0.0)));\n"
     "};\n"},
    // Which sample of the loop is the nearest to a place (core/waveguide_places.h).
    {"nearest",
     "nearest(share, to_held, u, right, period) = whole(to_held*period) + "
     "whole((away - to_held)*period)\n"
     "with {\n"
     "  whole(x) = select2(x < 0.0, floor(x + 0.5), ceil(x - 0.5));\n"
     "  from_end = 0.5*(1.0 - max(1.0/period, min(1.0 - 1.0/period, u)));\n"
     "  at = select2(right, from_end, 1.0 - from_end) - share;\n"
     "  away = select2(at > 0.0, at + 1.0, at);\n"
     "};\n"},
    {"late", "late(most, n, x) = x @ int(max(0.0, min(most, n)));\n"},
    {"filtered",
     "filtered(c, a, g, x) = x*(1.0 - a) : + ~ *(a) : *(g) : straight\n"
     "with {\n"
     "  straight(y) = c*y + y' : + ~ *(0.0 - c);\n"
     "};\n"},
    {"hat", "hat(i, p) = max(0.0, 1.0 - abs(p - i));\n"},
    {"along", "along(n, u) = (n - 1.0)*max(0.0, min(1.0, u));\n"},
};

// A formula on its way to text: what binds least in it.
struct Term {
  std::string text;
  Tightness tightness = Tightness::atom;
};

std::string held(const Term& term, Tightness tightness) {
  return term.tightness < tightness ? "(" + term.text + ")" : term.text;
}

Term called(const char* function, std::span<const Term> arguments) {
  std::string text = function;
  for (const Term& argument : arguments) {
    text += (&argument == arguments.data() ? "(" : ", ") + argument.text;
  }
  return {text + ")"};
}

Term joined(Op op, const Term& a, const Term& b) {
  using enum Tightness;
  switch (op) {
    case Op::add:
      return {a.text + " + " + held(b, product), sum};
    case Op::subtract:
      return {a.text + " - " + held(b, product), sum};
    case Op::multiply:
      return {held(a, product) + "*" + held(b, atom), product};
    case Op::divide:
      return {held(a, product) + "/" + held(b, atom), product};
    case Op::power:
      return called("pow", std::array{a, b});
    case Op::minimum:
      return called("min", std::array{a, b});
    default:
      return called("max", std::array{a, b});
  }
}

Term applied(const Step& step, std::span<const Term> taken,
             std::span<const std::string> parameters) {
  switch (step.op) {
    case Op::number:
      return {faust_number(step.value)};
    case Op::parameter:
      return {parameters[step.index]};
    case Op::negate:
      return {"0.0 - " + held(taken[0], Tightness::product), Tightness::sum};
    case Op::sqrt:
      return called("sqrt", taken);
    case Op::abs:
      return called("abs", taken);
    case Op::sin:
      return called("sin", taken);
    case Op::cos:
      return called("cos", taken);
    case Op::exp:
      return called("exp", taken);
    case Op::clamp:
      return {"min(max(" + taken[0].text + ", " + taken[1].text + "), " + taken[2].text + ")"};
    default:
      return joined(step.op, taken[0], taken[1]);
  }
}

}  // namespace

std::string FaustNames::add(std::string_view label) {
  std::string name(label);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !is_word(c); }, '_');
  std::string free = name;
  for (int i = 2; !taken_.insert(free).second; ++i) {
    free = name + "_" + std::to_string(i);
  }
  return free;
}

std::string faust_number(double number) {
  std::string text = print_number(number);
  if (text.find('.') == std::string::npos) {
    text.insert(std::min(text.find('e'), text.size()), ".0");  // an integer is another type
  }
  return text[0] == '-' ? "(" + text + ")" : text;
}

std::string faust_formula(std::span<const Step> formula, std::span<const std::string> parameters,
                          Tightness tightness) {
  std::vector<Term> stack;
  for (const Step& step : formula) {
    const auto first = stack.end() - static_cast<std::ptrdiff_t>(operands(step.op));
    Term term = applied(step, std::span<const Term>(first, stack.end()), parameters);
    stack.erase(first, stack.end());
    stack.push_back(std::move(term));
  }
  return held(stack.back(), tightness);
}

std::string faust_sum(std::vector<std::string> terms) {
  if (terms.empty()) {
    return "0.0";
  }
  std::stable_partition(terms.begin(), terms.end(),
                        [](const std::string& term) { return term[0] == '+'; });
  if (terms[0][0] == '+') {
    terms[0].erase(0, 2);
  } else {
    terms.insert(terms.begin(), "0.0");
  }
  return flow(terms, " ", 6);
}

std::string flow(std::span<const std::string> words, std::string_view between, std::size_t indent) {
  std::string text;
  std::size_t column = indent;
  for (const std::string& word : words) {
    if (!text.empty()) {
      text += between;
      if (column + word.size() > line_width) {
        text.erase(text.find_last_not_of(' ') + 1);
        text += "\n" + std::string(indent, ' ');
        column = indent;
      }
    }
    text += word;
    column += word.size() + between.size();
  }
  return text;
}

std::string plain(std::string_view text) {
  std::string clean(text);
  // Brackets, slashes and colons mean something in a slider's name.
  std::replace_if(
      clean.begin(), clean.end(),
      [](char c) {
        return !is_word(c) && std::string_view(" .,+-()").find(c) == std::string_view::npos;
      },
      '_');
  return clean;
}

std::string faust_slider(const ParameterSetting& setting) {
  const double span = setting.maximum - setting.minimum;
  if (!(span > 0.0)) {
    return faust_number(setting.value);
  }
  const double step = std::pow(10.0, std::floor(std::log10(span / 1000.0)));
  std::string text = "hslider(\"" + plain(setting.name) + "\"";
  for (const double number : {setting.value, setting.minimum, setting.maximum, step}) {
    text += ", " + faust_number(number);
  }
  return text + ")";
}

std::string faust_laws(const std::set<std::string>& used) {
  std::vector<FaustDefinition> definitions;
  for (const LawFacts& law : law_table()) {
    definitions.push_back({law.name, law.faust});
  }
  definitions.insert(definitions.end(), std::begin(helpers), std::end(helpers));
  const auto passive = faust_passive_definitions();
  definitions.insert(definitions.end(), passive.begin(), passive.end());
  const auto calls = [](std::string_view text, std::string_view name) {
    for (std::size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1)) {
      const std::size_t end = at + name.size();
      if (at > 0 && !is_word(text[at - 1]) && end < text.size() && text[end] == '(') {
        return true;
      }
    }
    return false;
  };
  std::vector<bool> is_used(definitions.size());
  const auto use = [&](const auto& self, std::size_t i) -> void {
    if (is_used[i]) {
      return;
    }
    is_used[i] = true;
    for (std::size_t other = 0; other < definitions.size(); ++other) {
      if (calls(definitions[i].text, definitions[other].name)) {
        self(self, other);
      }
    }
  };
  for (std::size_t i = 0; i < definitions.size(); ++i) {
    if (used.contains(std::string(definitions[i].name))) {
      use(use, i);
    }
  }
  std::string text;
  for (std::size_t i = 0; i < definitions.size(); ++i) {
    text += is_used[i] ? definitions[i].text : "";
  }
  return text;
}

std::string faust_prelude(bool rescale) {
  const std::string rate = rescale ? "44100.0/fconstant(int fSamplingFreq, <math.h>);  // numbers "
                                     "are per sample at 44100 Hz\n"
                                   : "1.0;  // numbers are per sample, at whatever rate\n";
  return "r = " + rate +
         "first(a) = a*(1 - 1');  // at the first tick only\n"
         "was(start, x) = x' + first(start);\n"
         "travel(start, v) = v + first(start) : + ~ _;\n"
         "push(f) = f*r*r;\n";
}

}  // namespace ressort::model
