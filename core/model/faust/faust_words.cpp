#include "core/model/faust/faust_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/laws/law.h"
#include "core/model/language/expression.h"

namespace ressort::model {
namespace {

constexpr std::size_t line_width = 100;

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

// FAUST definitions other than laws. A comparison only ever selects here and in the laws' texts:
// FAUST takes ten times as long to infer the types of a program that computes with comparisons.
constexpr std::string_view helpers = R"(
swing(m, k, z, x0, v0, f) = step ~ (_, _)
with {
  step(x, v) = before + now, now with {
    before = x + first(x0);
    speed = v + first(v0);
    now = speed + (f - spring(k, z, before, speed))/m;
  };
};
// M, K and Z of a body's mode, as they are stepped (core/sampled_mode.h).
sampled(m, k, z) = mass, mass*(ring + out*(1.0 - ring)), mass*(lost + out*(1.0 - lost))
with {
  stiff = k/m*r*r;
  half = 0.5*z/m*r;
  square = stiff - half*half;
  root = 0.5*sqrt(abs(square));
  decay = exp(0.0 - half);
  sine = sin(root);
  creep = exp(root) - exp(0.0 - root);
  swing = select2(square > 0.0, 0.0 - 0.5*creep*creep, 2.0*sine*sine);
  ring = (1.0 - decay)*(1.0 - decay) + 2.0*decay*swing;
  lost = 1.0 - decay*decay;
  out = max(0.0, min(1.0, (square - 8.2)/1.6));
  mass = m*(1.0 + out*(stiff - 1.0));
};
// The filters of a waveguide (core/kernels/waveguides/design.h) that is at least `least` samples
// long.
guide(least, hz, t60, brightness) = samples, rate/f, allpass, pole, gain
with {
  rate = fconstant(int fSamplingFreq, <math.h>);
  f = max(15.0, min(hz, rate/(least + 1.5)));
  bright = max(0.0, min(1.0, brightness));
  turn = 6.283185307179586;
  theta = turn*f/rate;
  decay = 6.907755278982137/(max(t60, 3.0/f)*rate);
  loss = decay*rate/f;
  abs2(a, b) = a*a + b*b;
  over(a, b, x, y) = (a*x + b*y)/abs2(x, y), (b*x - a*y)/abs2(x, y);
  less(a, b, x, y) = a - x, b - y;
  // 1/z at the tone's pole z, and 1 - 1/z
  re = exp(decay)*cos(theta);
  im = 0.0 - exp(decay)*sin(theta);
  rise = 2.0*exp(decay)*sin(0.5*theta)*sin(0.5*theta) - (exp(decay) - 1.0);
  // ln of the loss filter there, with the pole 1 - e^room
  size(room) = 0.0 - 0.5*log(abs2(1.0 + x*rise, x*im)) with { x = exp(0.0 - room) - 1.0; };
  angle(room) = atan2(x*im, 1.0 + x*rise) with { x = exp(0.0 - room) - 1.0; };
  delay(room) = (turn + angle(room))/theta;
  loud(room) = 0.0 - loss*bright + size(room) + decay*delay(room);
  half(i, low) = select2(loud(middle) > 0.0, middle, low)
  with {
    middle = low + 30.0/pow(2.0, i);
  };
  found = 0.0 - 60.0 : seq(i, 12, half(i)) : seq(i, 3, nearer);
  nearer(room) = room - loud(room)/(by_room(room) : _, *(decay/theta) : +);
  wants = (bright < 1.0) & (loud(0.0) > 0.0);
  fits = delay(found) >= least + 0.5;
  is_dark = wants & fits;
  first_room = select2(is_dark, 0.0, found);
  log_gain = 0.0 - loss*select2(wants & (delay(found) < least + 0.5), bright, 1.0);
  samples = max(least, floor(delay(first_room) - 0.500000001));
  rest = (delay(first_room) - samples)*theta;
  first_allpass = sin(0.5*(theta - rest))/sin(0.5*(theta + rest));
  // ln of the whole loop, and its derivatives by both filters
  level(room, c) = log_gain + size(room) +
    0.5*log(abs2(c + re, im)/abs2(1.0 + c*re, c*im)) + samples*decay;
  phase(room, c) = remainder(
    angle(room) + atan2(im, c + re) - atan2(c*im, 1.0 + c*re) - samples*theta, turn);
  by_room(room) = over(rise, 0.0 - im, e + (1.0 - e)*rise, 0.0 - (1.0 - e)*im)
  with {
    e = exp(room);
  };
  by_allpass(c) = over(1.0, 0.0, c + re, im), over(re, im, 1.0 + c*re, c*im) : less;
  newton(room, c) = level(room, c), phase(room, c), by_room(room), by_allpass(c) : step
  with {
    step(x, y, a, b, c1, d) =
      room - (x*d - y*c1)/(a*d - b*c1), c - (a*y - b*x)/(a*d - b*c1);
  };
  both = found, first_allpass : seq(i, 3, newton);
  dark_room = both : _, !;
  dark_allpass = both : !, _;
  is_solved = (dark_room <= 0.0) & (abs(dark_allpass) < 1.0);
  alone(c) = c - phase(0.0, c)/(by_allpass(c) : !, _);
  flat = first_allpass : seq(i, 3, alone);
  pole = select2(is_dark, 0.0, 1.0 - exp(select2(is_solved, found, dark_room)));
  allpass = select2(is_dark, flat, select2(is_solved, first_allpass, dark_allpass));
  gain = min(1.0, exp(log_gain - select2(is_dark, level(0.0, flat), 0.0)));
};
// The sample of the loop that is nearest to a place (core/waveguide_places.h).
nearest(share, to_held, u, right, period) =
  whole(to_held*period) + whole((away - to_held)*period)
with {
  whole(x) = select2(x < 0.0, floor(x + 0.5), ceil(x - 0.5));
  from_end = 0.5*(1.0 - max(1.0/period, min(1.0 - 1.0/period, u)));
  at = select2(right, from_end, 1.0 - from_end) - share;
  away = select2(at > 0.0, at + 1.0, at);
};
late(most, n, x) = x @ int(max(0.0, min(most, n)));
filtered(c, a, g, x) = x*(1.0 - a) : + ~ *(a) : *(g) : straight
with {
  straight(y) = c*y + y' : + ~ *(0.0 - c);
};
hat(i, p) = max(0.0, 1.0 - abs(p - i));
along(n, u) = (n - 1.0)*max(0.0, min(1.0, u));
changed(x) = (x - x')/r;
// The force g(x) at the x that solves x + gamma g(x) = free between `far` and `free`: `count` steps
// of Newton's method, with bisection where a step would leave the bracket or g falls too steeply.
between(count, g, far, start, free, gamma) =
  min(far, free), max(far, free), max(min(far, free), min(max(far, free), start)) :
  seq(i, count, nearer) : !, !, _ : arrived
with {
  nearer(low, high, x) = g(x) : go with {
    go(value, slope) = bottom, top, select2(fits, 0.5*(bottom + top), newton) with {
      over = x - free + gamma*value;
      steep = 1.0 + gamma*slope;
      bottom = select2(over < 0.0, low, x);
      top = select2(over < 0.0, x, high);
      newton = x - over/steep;
      fits = (newton >= bottom) & (newton <= top) & (steep > 0.0);
    };
  };
  arrived(x) = g(x) : last with {
    last(value, slope) = value - slope*(x - free + gamma*value)/(1.0 + gamma*slope);
  };
};
// The same for a g that never falls, with a damper z.
risen(g, z, way, gamma) =
  between(24, both, way - gamma*(both(way) : _, !), way, way, gamma)
with {
  both(s) = g(s) : +(z*s), +(z);
};
// The discrete gradient of a potential between b and b + s, and its slope: e is the energy, f the
// force, g the slope of the force. The force in the middle where b + s is too near to b.
discrete(e, f, g, b, s) =
  select2(is_near, quotient, f(b + 0.5*s)),
  select2(is_near, (f(b + s) - quotient)/wide, 0.5*g(b + 0.5*s))
with {
  far = abs(b) + abs(b + s);
  is_near = abs(s) <= max(0.000004*far, select2(far < 1e-150, 0.0, 1.0));
  wide = select2(is_near, s, 1.0);
  quotient = (e(b + s) - e(b))/wide;
};
// The force in the very first sample of a link that is under tension as it starts: its potential
// must not rise above its initial value.
first_alone(g, before, speed, way, gamma) =
  select2(abs(force)*gamma > abs(way), force, way/gamma)
with {
  falls = (g(before, speed) : _, !)*speed < 0.0;
  lead = select2(falls, 0.0, speed);
  force = between(48, risen_from, 0.0, way, way, gamma);
  risen_from(s) = g(before + lead, s - lead) : gated with {
    gated(value, slope) = select2(rises, 0.0, share), select2(rises, 0.0, bend) with {
      w = s - lead;
      rises = (value*w > 0.0) & (select2(falls, 1.0, w*speed) > 0.0);
      wide = select2(falls & rises, 1.0, s);
      share = select2(falls, value, value*w/wide);
      bend = select2(falls, slope, (value + slope*w - share)/wide);
    };
  };
};
// The share of two samples for which a contact touches, by its depths before, now and after.
inside(before, now, after) = 0.5*(share(before, now) + share(now, after))
with {
  share(a, b) = select2(a == b, (max(0.0, b) - max(0.0, a))/select2(a == b, b - a, 1.0),
    select2(a > 0.0, 0.0, 1.0));
};
)";

struct Definition {
  std::string name;
  std::string text;
};

// Splits FAUST text into its definitions. Each one starts in the first column with its name and a
// parenthesis, after its comment.
void split_definitions(std::string_view text, std::vector<Definition>& definitions) {
  std::string comment;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, std::min(text.size(), text.find('\n') + 1));
    text.remove_prefix(line.size());
    const std::size_t name =
        std::min(line.size(),
                 static_cast<std::size_t>(std::ranges::find_if_not(line, is_word) - line.begin()));
    if (line.starts_with("//")) {
      comment += line;
    } else if (name > 0 && name < line.size() && line[name] == '(') {
      definitions.push_back({std::string(line.substr(0, name)), comment + std::string(line)});
      comment.clear();
    } else if (!definitions.empty()) {
      definitions.back().text += line;
    }
  }
}

// A part of a formula, and the lowest precedence in its text.
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
    text.insert(std::min(text.find('e'), text.size()), ".0");  // FAUST would read an integer
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

std::string faust_scaled(const std::string& value, Unit unit) {
  switch (unit) {
    case Unit::stiffness:
      return value + "*r*r";
    case Unit::damping:
    case Unit::friction:
    case Unit::speed:
      return value + "*r";
    case Unit::plain:
    case Unit::inverse_mass:
    case Unit::inverse_impedance:
    case Unit::frequency:
    case Unit::gravity:
    case Unit::gravity_per_rate:
      break;
  }
  return value;
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
  // Brackets, slashes and colons have a meaning in a slider's name.
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

std::string faust_laws(const std::set<std::string>& used, std::span<const LawFacts> laws) {
  std::vector<Definition> definitions;
  for (const LawFacts& law : laws) {
    const std::string name(law.name);
    std::string arguments;
    for (std::size_t i = 1; i <= law.count; ++i) {
      arguments += "p" + std::to_string(i) + ", ";
    }
    const std::string solved = arguments + "f, damping, b, speed, way, gamma)";
    const std::string gradient = "gradient_" + name + "(" + arguments;
    const std::size_t first = definitions.size();
    split_definitions(law.faust, definitions);
    if (std::none_of(definitions.begin() + static_cast<std::ptrdiff_t>(first), definitions.end(),
                     [&](const Definition& one) { return one.name == "alone_" + name; })) {
      definitions.push_back({"alone_" + name, "alone_" + name + "(" + solved + " =\n  f + risen(" +
                                                  gradient +
                                                  "b), damping, way - gamma*f, gamma);\n"});
    }
    definitions.push_back({"start_" + name, "start_" + name + "(" + solved +
                                                " =\n  select2(1', first_alone(" +
                                                gradient.substr(0, gradient.size() - 2) +
                                                "), b, speed, way, gamma),\n  alone_" + name + "(" +
                                                solved + ");\n"});
  }
  split_definitions(helpers, definitions);
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
    if (used.contains(definitions[i].name)) {
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
                                   : "1.0;  // numbers are per sample, at any rate\n";
  return "r = " + rate +
         "first(a) = a*(1 - 1');  // in the first sample only\n"
         "was(start, x) = x' + first(start);\n"
         "travel(start, v) = v + first(start) : + ~ _;\n"
         "push(f) = f*r*r;\n";
}

}  // namespace ressort::model
