// Printing networks: exact texts, and reading them back.
#include "core/model/language/print.h"

#include <algorithm>

#include "app/session/files.h"
#include "core/laws/laws.h"
#include "core/model/language/expression.h"
#include "core/model/topology.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"

namespace ressort::print_test {
namespace {

using support::network_of;
using support::Random;

void check_round_trip(const Network& network) {
  const std::string text = print_network(network);
  INFO(text);
  const ParsedNetwork parsed = parse_network(text);
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    if (diagnostic.severity == Severity::error) {
      FAIL(to_string(diagnostic, "printed"));
    }
  }
  REQUIRE(parsed.network == network);
  REQUIRE(print_network(parsed.network) == text);
}

bool has_line(const std::string& text, const std::string& line) {
  return ("\n" + text).find("\n" + line + "\n") != std::string::npos;
}

}  // namespace

TEST_CASE("a network is printed in sections, with one element per line", "[print]") {
  const std::string printed =
      "# Parameters\n"
      "@k param 0.1\n"
      "@slide audioParam @in2\n"
      "\n"
      "# Masses\n"
      "@g ground 0\n"
      "~begin left\n"
      "@m mass 1 0.002 [1 2 0] -100\n"
      "@o osc 1 0.5*k 0.01 3 0\n"
      "~end left\n"
      "@n mass 2 [0.5 0 0] 0\n"
      "\n"
      "# Macros\n"
      "~begin left\n"
      "@s string 10 1 k 0.001 0 0\n"
      "~end left\n"
      "@me closedMesh 5 4 1 k 0.001 0.0005 0 0\n"
      "\n"
      "# Links\n"
      "@r springDamper @g @m k 0.001\n"
      "@r springDamper @m @o [k+0.1] 0.001\n"
      "@c nlContact @m [@s slide-0.5] 0 0.01 0.5 0.001\n"
      "@d damper [@me k+0.1 0.5] @n 0.001\n"
      "\n"
      "# Inputs\n"
      "@in1 frcInput @o\n"
      "~begin left\n"
      "@in3 posInput [0 1 0.5]\n"
      "~end left\n"
      "\n"
      "# Outputs\n"
      "@out1 posOutput [@s 0.2]\n"
      "@out2 frcOutput @in3\n";
  CHECK(print_network(network_of(printed)) == printed);
  // The same network in other words, another order, and partly the other dialect.
  const std::string written =
      "@out2 frcOutput @in3\n@out1 posOutput @s 0.20\n@in1 forceInput @o\n@g ground 0.\n"
      "~begin left\n@in3 posInput [0 1 .5]\n@m mass 1.0 0.002 [1 2 0] -1e2\n"
      "@o cel 1. '0.5 * k' .01 3 0\n@s string 10 1 k 1e-3 0 0\n~end left\n@n mass 2 [.5 0 0] 0\n"
      "@me closedMesh 5 4 1 (k) 0.001 0.0005 0 0\n@k param .1\n@slide audioParam @in2\n"
      "@r springDamperDamper @g @m k 0.001\n@r spring @m @o k+0.1 0.001\n"
      "@c nlContact @m [@s slide - 0.5] 0 0.01 0.5 0.001\n@d damper [@me k+0.1 0.5] @n 0.001";
  CHECK(network_of(written) == network_of(printed));
  CHECK(print_network(network_of(written)) == printed);
}

TEST_CASE("all variants of a keyword are printed in one form", "[print]") {
  struct Form {
    std::string written;
    std::string printed;
  };
  const std::string two = "@a mass 1 0 0\n@b mass 1 0 0\n";
  for (const Form& form : {
           Form{"@g ground 1. membrane 0.5 2.", "@g ground [0.5 2 1]"},
           Form{"@m mass 2. 1. 1.", "@m mass 2 1 1"},
           Form{"@m mass 2. 1. 1. membrane 1 2", "@m mass 2 [1 2 1] 1"},
           Form{"@m mass 2. 1. 1. membrane 0 0", "@m mass 2 1 1"},
           Form{"@m mass 2. .5 [1. 2. 3.] 4.", "@m mass 2 0.5 [1 2 3] 4"},
           Form{"@m massG 2. .5 3. 4.", "@m massG 2 0.5 3 4"},
           Form{"@m massG 2. .5 3. 4. membrane 1 2", "@m massG 2 0.5 [1 2 3] 4"},
           Form{"@m osc 1. 2. 3. 4. 5.", "@m osc 1 2 3 4 5"},
           Form{"@m cel 1. 2. 3. 4. 5. 6.", "@m osc 1 2 3 4 5 6"},
           Form{"@in5 posInput 1e30", "@in5 posInput 1e30"},
           Form{"@in5 forceInput @a", "@in5 frcInput @a"},
           Form{"@out5 posOutput @a", "@out5 posOutput @a"},
           Form{"@out5 frcOutput @a", "@out5 frcOutput @a"},
           Form{"@p param -1e+20", "@p param -1e20"},
           Form{"@p audioParam @in7", "@p audioParam @in7"},
           Form{"@l spring @a @b 1.", "@l spring @a @b 1"},
           Form{"@l spring @a @b 1. 2.", "@l springDamper @a @b 1 2"},
           Form{"@l springDamper @a @b 1.", "@l spring @a @b 1"},
           Form{"@l springDamperDamper @a @b 1. 2.", "@l springDamper @a @b 1 2"},
           Form{"@l damper @a @b 1.", "@l damper @a @b 1"},
           Form{"@l nlSpring @a @b 1 2 3", "@l nlSpring2 @a @b 1 2 3"},
           Form{"@l nlSpring2 @a @b 1 2 3", "@l nlSpring2 @a @b 1 2 3"},
           Form{"@l nlSpring3 @a @b 1 2 3", "@l nlSpring3 @a @b 1 2 3"},
           Form{"@l nlSpringDamper @a @b 1 2 3 4", "@l nlSpringDamper @a @b 1 2 3 4"},
           Form{"@l nlPluck @a @b 1 2", "@l nlPluck @a @b 1 2"},
           Form{"@l nlPluck @a @b 1 2 3", "@l nlPluck @a @b 1 2 3"},
           Form{"@l nlBow @a @b 1 2", "@l nlBow @a @b 1 2"},
           Form{"@l nlBow @a @b 1 2 0", "@l nlBow @a @b 1 2"},
           Form{"@l nlBow @a @b 1 2 [1]", "@l nlBow @a @b 1 2 1"},
           Form{"@l nlBow @a @b 1 2 (2-1)", "@l nlBow @a @b 1 2 1"},
           Form{"@p param 0\n@l nlBow @a @b 1 2 p", "@l nlBow @a @b 1 2 p"},
           Form{"@p param 0\n@l nlBow @a @b 1 2 [1 - p]", "@l nlBow @a @b 1 2 1-p"},
           Form{"@l contact @a @b 1 2", "@l contact @a @b 1 2"},
           Form{"@l detent @a @b 1 2 3", "@l contact @a @b 1 2 3"},
           Form{"@l nlContact @a @b 1 2 3 4", "@l nlContact @a @b 1 2 3 4"},
           Form{"@l nlContact @a @b 1 2 3 4 5", "@l nlContact @a @b 1 2 3 4 5"},
           Form{"@s string 9 1 .2 .3 0.", "@s string 9 1 0.2 0.3 0 0"},
           Form{"@s string 9 1 .2 .3 .4 [1 2 3] [4 5 6]", "@s string 9 1 0.2 0.3 0.4 [1 2 3] 6"},
           Form{"@s chain 9 1 .2 .3 1.", "@s chain 9 1 0.2 0.3 1 1"},
           Form{"@s stiffString 9 1 .2 .3 .4 0.", "@s stiffString 9 1 0.2 0.3 0.4 0 0"},
           Form{"@s stiffString 9 1 .2 .3 .4 .5 1 2", "@s stiffString 9 1 0.2 0.3 0.4 0.5 1 2"},
           Form{"@s mesh 9 3 1 .2 .3 0.", "@s mesh 9 3 1 0.2 0.3 0 0"},
           Form{"@s closedMesh 9 3 1 .2 .3 0. 1.", "@s closedMesh 9 3 1 0.2 0.3 0 1"},
           Form{"@s cornerMesh 9 3 1 .2 .3 .4 0. 1.", "@s cornerMesh 9 3 1 0.2 0.3 0.4 0 1"},
           Form{"@s string 9 1 1 0 0\n@l contact @s @a 1 2 3 0.5", "@l contact [@s 0.5] @a 1 2 3"},
           Form{"@s mesh 9 3 1 1 0 0\n@out3 posOutput @s 0.5:0.25",
                "@out3 posOutput [@s 0.5 0.25]"},
           Form{"@s mesh 9 3 1 1 0 0\n@t string 9 1 1 0 0\n@l spring @s @t 1 0.5:0.25 0.75",
                "@l spring [@s 0.5 0.25] [@t 0.75] 1"},
       }) {
    const Network network = network_of(two + form.written);
    const std::string text = print_network(network);
    INFO(form.written << "\n--\n" << text);
    CHECK(has_line(text, form.printed));
    check_round_trip(network);
  }
}

TEST_CASE("links with the same label are preserved", "[print]") {
  const Network network = network_of(
      "@in01 mass 1 0 0\n@in1 posInput 0\n@a spring @in01 @in1 1\n"
      "@a spring @in01 @in1 2\n@out3 posOutput @in1\n");
  CHECK(network.links.size() == 2);
  check_round_trip(network);
  CHECK_FALSE(parse_network("@a spring @b @c 1\n@b mass 1 0 0\n@c mass 1 0 0\n@a mass 1 0 0").ok());
  CHECK_FALSE(parse_network("@a mass 1 0 0\n@b mass 1 0 0\n@a spring @a @b 1").ok());
}

TEST_CASE("expressions are printed with the fewest parentheses", "[print]") {
  const std::vector<std::string> names = {"a", "b", "c"};
  struct Form {
    const char* written;
    const char* printed;
  };
  for (const Form& form : {Form{"a - (b - c)", "a-(b-c)"},
                           Form{"(a - b) - c", "a-b-c"},
                           Form{"a + (b + c)", "a+(b+c)"},
                           Form{"a - (b + c)", "a-(b+c)"},
                           Form{"(a + b) * c", "(a+b)*c"},
                           Form{"a + b * c", "a+b*c"},
                           Form{"a / (b / c)", "a/(b/c)"},
                           Form{"(a / b) / c", "a/b/c"},
                           Form{"a / (b * c)", "a/(b*c)"},
                           Form{"a * (b * c)", "a*(b*c)"},
                           Form{"-a * b", "-a*b"},
                           Form{"-(a * b)", "-(a*b)"},
                           Form{"-(-a)", "-(-a)"},
                           Form{"--a", "a"},
                           Form{"a - -b", "a--b"},
                           Form{"a * -b", "a*-b"},
                           Form{"-2", "-2"},
                           Form{"-2 * a", "-2*a"},
                           Form{"a - -2", "a--2"},
                           Form{"-(a + b)", "-(a+b)"},
                           Form{"(((a)))", "a"},
                           Form{"sqrt(a / 3)", "sqrt(a/3)"},
                           Form{"-sin(a)", "-sin(a)"},
                           Form{"pow(a + b, 2)", "pow(a+b,2)"},
                           Form{"min(a, max(b, c))", "min(a,max(b,c))"},
                           Form{"clamp(a, -1, b * 2)", "clamp(a,-1,b*2)"},
                           Form{"abs(cos(exp(a)))", "abs(cos(exp(a)))"},
                           Form{"1e+20 * a", "1e20*a"},
                           Form{"0.1", "0.1"},
                           Form{"-0", "-0"}}) {
    INFO(form.written);
    const auto formula = parse_expression(form.written, names);
    REQUIRE(formula);
    const std::string printed = print_expression(*formula, names);
    CHECK(printed == form.printed);
    const auto again = parse_expression(printed, names);
    REQUIRE(again);
    CHECK(*again == *formula);
  }
}

TEST_CASE("'~motion' is printed only if it is needed", "[print]") {
  const auto starts = [](const std::string& text) {
    const Network network = network_of(text);
    check_round_trip(network);
    const std::string printed = print_network(network);
    return printed.starts_with("~motion") ? printed.substr(0, printed.find('\n')) : "";
  };
  CHECK(starts("@m mass 1 0 0").empty());
  CHECK(starts("@m mass 1 1 1").empty());
  CHECK(starts("@m mass 1 1 0").empty());
  CHECK(starts("@m mass 1 1 0.9").empty());
  CHECK(starts("~motion delayed\n@m mass 1 1 0.9").empty());
  CHECK(starts("~motion velocity\n@m mass 1 1 0.9") == "~motion velocity");
  CHECK(starts("~motion delayed\n@m mass 1 1 0") == "~motion delayed");
  // A bow's profile of 0 reveals one dialect but is not printed; a drawing reveals the other.
  CHECK(starts("@m mass 1 1 2\n@n mass 1 0 0\n@l nlBow @m @n 1 1 0") == "~motion velocity");
  CHECK(starts("@m mass 1 1 1 membrane 1 2") == "~motion delayed");
  // A jump from 0 next to a mass at rest elsewhere: without '~motion' the jump would be read as
  // rest.
  CHECK(starts("~motion delayed\n@m mass 1 1 0\n@n mass 1 0 1") == "~motion delayed");
}

TEST_CASE("equal networks compare equal in any order of arguments", "[print]") {
  const Network plain = network_of(
      "@p param 2\n@m mass 1 0 0\n@o osc 1 0.5 p*2 0 0\n@l springDamper @m @o 1 0.5\n"
      "@s string 5 1 p 0.5 0 0\n@in1 posInput 0\n@in2 frcInput [@s 0.5]\n@out1 posOutput [@s 1]");
  CHECK(plain.arguments.size() == 4);  // 1, 0.5, p*2, p
  CHECK(plain.taps.size() == 2);
  CHECK(network_of("@out1 posOutput [@s 1.0]\n@in2 frcInput [@s .5]\n@in1 posInput 0\n"
                   "@s string 5 1. p .5 0 0\n@l springDamper @m @o 1e0 5e-1\n@m mass 1.00 0 0\n"
                   "@o osc 1 [.5] [(p * 2)] 0 0\n@p param 2.") == plain);
  CHECK(canonical(plain) == plain);
  // A point that two ends share becomes one point each.
  Network shared = plain;
  shared.outputs[0].mass = shared.inputs[1].mass;
  const Network parted = canonical(shared);
  CHECK(parted.taps.size() == 2);
  CHECK(parted.inputs[1].mass != parted.outputs[0].mass);
  CHECK(parted.taps[1] == parted.taps[0]);
}

TEST_CASE("unnamed elements are printed with unused names", "[print]") {
  const Network network = network_of(
      "@m0 param 0.5\n@r0 ground 0\n@s string 5 1 1 m0 0 0\n@x chain 3 1 1 0 0.001 0 0\n"
      "@l spring @r0 [@s 0.25] 1\n@k spring @r0 [@s 0.3] 1\n@out1 posOutput [@s m0]\n");
  const Network expanded = expand_macros(network);
  const std::string text = print_network(expanded);
  INFO(text);
  const Network read = network_of(text);
  CHECK(read.masses.size() == 1 + 5 + 3);
  CHECK(read.links.size() == 2 + 4 + 2);
  // 0.25 is a node; 0.3 lies between two nodes; a parameter may change.
  CHECK(read.masses[read.links[0].b].name == "m2");
  CHECK(has_line(text, "# at 0.3 of what was a macro; its nearest mass stands for that place"));
  CHECK(has_line(text, "# at m0 of what was a macro; its nearest mass stands for that place"));
  CHECK(text.find("@l ") < text.find("# at 0.3"));
  check_round_trip(read);
}

TEST_CASE("every shipped model reads back unchanged after printing", "[print]") {
  const auto names = known_models();
  CHECK(names.size() >= 9);
  for (const std::string& name : names) {
    INFO(name);
    const auto text = read_text(models_folder() + "/" + name + ".mdl", max_model_bytes);
    REQUIRE(text);
    check_round_trip(network_of(*text));
  }
}

namespace {

// Random networks as a text could describe them, with arguments in random order.
class Maker {
 public:
  explicit Maker(std::uint64_t seed) : random_(seed) {}

  Network make() {
    network_ = Network();
    names_ = 0;
    network_.third =
        chance() ? ThirdArgument::velocity_per_second : ThirdArgument::delayed_position;
    for (std::size_t i = random_.below(4); i-- > 0;) {
      Parameter parameter{.name = "p" + std::to_string(i)};
      (chance() ? parameter.audio_input = 1 + static_cast<int>(random_.below(64)) : 0) > 0
          ? parameter.value = 0.0
          : parameter.value = number();
      network_.parameters.push_back(parameter);
    }
    for (std::size_t i = 1 + random_.below(6); i-- > 0;) {
      add_mass();
    }
    for (std::size_t i = random_.below(3); i-- > 0;) {
      add_macro();
    }
    for (int i = 1; i <= static_cast<int>(random_.below(5)); ++i) {
      add_input(i);
    }
    for (std::size_t i = random_.below(8); i-- > 0;) {
      add_link();
    }
    for (int i = static_cast<int>(random_.below(4)); i > 0; --i) {
      network_.outputs.push_back({.number = 20 * i - static_cast<int>(random_.below(20)),
                                  .is_force = chance(),
                                  .mass = end()});
    }
    return network_;
  }

 private:
  bool chance() { return random_.below(2) == 0; }
  double number() {
    static constexpr double some[] = {0.0, 1.0, -1.0, 0.1, 1e-7, 1e22, -0.2, 44100.0, -0.0};
    return chance() ? some[random_.below(std::size(some))] : random_.uniform(-2.0, 2.0);
  }
  std::string name() {
    static constexpr const char* endings[] = {"",  "_0", "'s",       "+x", ":2",
                                              "@", "(*", "\xc3\xa9", "]"};
    return "n" + std::to_string(names_++) + endings[random_.below(std::size(endings))];
  }

  ArgumentId argument(const Formula& formula) {
    network_.arguments.push_back(formula);
    return static_cast<ArgumentId>(network_.arguments.size() - 1);
  }
  ArgumentId argument() { return argument(formula(3)); }
  ArgumentId maybe() { return chance() ? argument() : no_argument; }

  Formula formula(int depth) {
    Formula made = tree(depth);
    if (is_constant(made) && !std::isfinite(evaluate(made, {}))) {
      return {{Op::number, 0, 0.5}};
    }
    return made;
  }

  Formula tree(int depth) {
    if (depth == 0 || random_.below(3) == 0) {
      if (!network_.parameters.empty() && chance()) {
        const auto index = static_cast<std::uint32_t>(random_.below(network_.parameters.size()));
        return {{Op::parameter, index, 0.0}};
      }
      return {{Op::number, 0, number()}};
    }
    const auto op = static_cast<Op>(2 + random_.below(14));
    const bool is_unary = op == Op::negate || (op >= Op::sqrt && op <= Op::exp);
    Formula made = tree(depth - 1);
    if (op == Op::negate && made.size() == 1 && made[0].op == Op::number) {
      return made;  // the reader folds a negated number
    }
    for (int i = is_unary ? 1 : op == Op::clamp ? 3 : 2; i > 1; --i) {
      const Formula more = tree(depth - 1);
      made.insert(made.end(), more.begin(), more.end());
    }
    made.push_back({op, 0, 0.0});
    return made;
  }

  std::uint32_t drawing() {
    static constexpr const char* groups[] = {"", "a", "b", "[x y]", "~q"};
    if (chance()) {
      return 0;
    }
    const bool is_placed = chance();
    network_.drawings.push_back({groups[random_.below(std::size(groups))],
                                 is_placed ? number() : 0.0, is_placed ? number() : 0.0});
    return static_cast<std::uint32_t>(network_.drawings.size());
  }

  void add_mass() {
    Mass mass{.name = name(), .position = number(), .drawing = drawing()};
    mass.kind = static_cast<MassKind>(random_.below(3));
    if (mass.kind != MassKind::ground) {
      mass.mass = argument({{Op::number, 0, random_.uniform(0.1, 3.0)}});
      mass.third = chance() ? mass.position : number();
      if (random_.below(4) == 0) {
        mass.gravity = argument();
        mass.gravity_per_rate = mass.kind == MassKind::oscillator || chance();
      }
    }
    if (mass.kind == MassKind::oscillator) {
      mass.stiffness = argument();
      mass.damping = argument();
    }
    network_.masses.push_back(mass);
  }

  void add_macro() {
    Macro macro{.name = name(), .kind = static_cast<MacroKind>(random_.below(6))};
    std::erase(macro.name, ']');
    macro.length = 3 + static_cast<std::uint32_t>(random_.below(5));
    macro.width = is_mesh(macro.kind) ? 2 + static_cast<std::uint32_t>(random_.below(5)) : 1;
    macro.mass = argument({{Op::number, 0, random_.uniform(0.1, 3.0)}});
    macro.stiffness = argument();
    macro.second_stiffness = macro.kind == MacroKind::stiff_string ? argument() : no_argument;
    macro.damping = argument();
    macro.air_damping = maybe();
    macro.position = number();
    macro.third = chance() ? macro.position : number();
    macro.drawing = drawing();
    network_.macros.push_back(macro);
  }

  std::uint32_t end() {
    const std::size_t places = network_.macros.empty() ? 0 : random_.below(3);
    if (places == 0) {
      return static_cast<std::uint32_t>(random_.below(network_.masses.size()));
    }
    const auto macro = static_cast<std::uint32_t>(random_.below(network_.macros.size()));
    const bool is_plane = is_mesh(network_.macros[macro].kind);
    network_.masses.push_back(
        {.kind = MassKind::point, .tap = static_cast<std::uint32_t>(network_.taps.size())});
    network_.taps.push_back(
        {.macro = macro, .u = argument(), .v = is_plane ? argument() : no_argument});
    return static_cast<std::uint32_t>(network_.masses.size() - 1);
  }

  void add_input(int number_of_it) {
    Input input{.number = number_of_it, .is_force = chance()};
    if (input.is_force) {
      input.mass = end();
    } else {
      input.mass = static_cast<std::uint32_t>(network_.masses.size());
      network_.masses.push_back({.name = "in" + std::to_string(number_of_it),
                                 .kind = MassKind::position,
                                 .position = number(),
                                 .drawing = drawing()});
    }
    network_.inputs.insert(network_.inputs.begin(), input);
  }

  void add_link() {
    Link link{.name = chance() ? "twice" : name()};
    link.law = static_cast<Law>(random_.below(law_count));
    const LawFacts& law = facts_of(link.law);
    const auto least = static_cast<std::size_t>(law.words[0].least);
    const std::size_t count = chance() ? law.count : least;
    for (std::size_t i = 0; i < count; ++i) {
      link.arguments[i] = argument();
    }
    if (link.law == Law::spring) {
      const std::size_t which = random_.below(3);
      link.arguments[0] = which < 2 ? argument() : no_argument;
      link.arguments[1] = which > 0 ? argument() : no_argument;
    }
    if (link.law == Law::either_bow) {  // its profile is not constant
      link.law = network_.parameters.empty() ? Law::bow : link.law;
      link.arguments[2] =
          network_.parameters.empty() ? no_argument : argument({{Op::parameter, 0, 0.0}});
    }
    link.a = end();
    link.b = end();
    network_.links.push_back(link);
  }

  Random random_;
  Network network_;
  int names_ = 0;
};

// Returns the same network with its arguments reversed and duplicated.
Network disordered(Network network) {
  const auto count = static_cast<ArgumentId>(network.arguments.size());
  std::reverse(network.arguments.begin(), network.arguments.end());
  std::vector<Formula> twice = network.arguments;
  twice.insert(twice.end(), network.arguments.begin(), network.arguments.end());
  network.arguments = std::move(twice);
  ArgumentId uses = 0;
  const auto move = [&](ArgumentId& id) {
    id = id == no_argument ? id : count - 1 - id + (++uses % 2) * count;
  };
  for (Mass& mass : network.masses) {
    move(mass.mass), move(mass.stiffness), move(mass.damping), move(mass.gravity);
  }
  for (Macro& macro : network.macros) {
    move(macro.mass), move(macro.stiffness), move(macro.second_stiffness);
    move(macro.damping), move(macro.air_damping);
  }
  for (Tap& tap : network.taps) {
    move(tap.u), move(tap.v);
  }
  for (Link& link : network.links) {
    for (ArgumentId& id : link.arguments) {
      move(id);
    }
  }
  return network;
}

}  // namespace

TEST_CASE("two thousand random networks read back unchanged after printing", "[print]") {
  constexpr std::uint64_t seed = 20260;
  Maker maker(seed);
  for (int i = 0; i < 2000; ++i) {
    INFO("network " << i << " of seed " << seed);
    const Network made = maker.make();
    const Network network = canonical(made);
    REQUIRE(canonical(network) == network);
    REQUIRE(canonical(disordered(made)) == network);
    check_round_trip(network);
  }
}

}  // namespace ressort::print_test
