// Synth-A-Modeler's models: units and signs, errors, and damaged texts.
#include <algorithm>
#include <cmath>

#include "core/laws/laws.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"
#include "tests/support/passive.h"
#include "tests/support/pitch.h"

namespace ressort::synth_a_modeler_test {
namespace {

using namespace support;
using messages::check_error;
using messages::check_told;
using messages::check_warning;

constexpr double fs = 44100.0;

double value_of(const Network& network, ArgumentId id) {
  return argument_value(network, id, parameter_values(network));
}

// Returns output 1 with constant inputs.
std::vector<double> rendered(const std::string& text, std::size_t frames, double hand = 0.0) {
  const Network network = expand_macros(network_of(text));
  Bare<double> bare(make_program(network, fs, true, schemes_of(network, Passivity::always).links));
  std::vector<double> y;
  for (std::size_t n = 0; n < frames; ++n) {
    y.push_back(network.inputs.empty() ? bare.step({})[0] : bare.step({hand})[0]);
  }
  return y;
}

const std::string string_of_two =
    "port(),hand;\n"
    "link(100.0,0.5,0.0),l,hand,j;\n"
    "waveguide(0.5,simpleString(0.02,0.002)),w0,bridge,j;\n"
    "waveguide(0.5,simpleString(0.02,0.003)),w1,j,fret;\n"
    "termination(memorylessStringTerm(-0.99)),bridge;\n"
    "termination(memorylessStringTerm(-0.98)),fret;\n"
    "junction(0.0),j;\n"
    "audioout,a,j;\n";

const std::string whole =
    "# all at once\n"
    "faustcode: stiff=hslider(\"Stiffness [N/m]\", 400.0, 50.0, 1000.0, 10.0);\n"
    "faustcode: half = stiff*0.5; // of it\n"
    "mass(0.001,0.0,0.0),head; # pos 10,20\n"
    "ground(0.0),rim;\n"
    "link(half*2.0,0.001,0.001),skin,head,rim,();\n"
    "touch(500.0,0.1,0.002),hit,hand,head;\n"
    "resonators(200.0,0.5,0.01, 330.5,0.3,0.04),box;\n"
    "link(100.0,0.01,0.0),foot,head,box;\n"
    "audioout,left,(head - box*0.5)*stiff;\n" +
    string_of_two;

}  // namespace

TEST_CASE("kilograms, newtons and metres become units per sample", "[synth_a_modeler]") {
  const Network network = network_of(
      "mass(0.001,0.002,3.0),m;\nground(-0.5),g;\nlink(400.0,0.02,0.0),l,m,g;\naudioout,a,m;\n");
  REQUIRE(network.masses.size() == 2);
  CHECK(network.masses[0].name.text() == "m");
  CHECK(value_of(network, network.masses[0].mass) == 1944810.0);  // 0.001 * 44100^2
  CHECK(network.masses[0].position == 0.002);
  CHECK(network.masses[0].third == 3.0);
  CHECK(network.third == ThirdArgument::velocity_per_second);
  CHECK(network.masses[1].kind == MassKind::ground);
  CHECK(network.masses[1].position == -0.5);
  REQUIRE(network.links.size() == 1);
  CHECK(network.links[0].law == Law::spring);
  CHECK(value_of(network, network.links[0].arguments[0]) == 400.0);
  CHECK(value_of(network, network.links[0].arguments[1]) == 882.0);  // 0.02 * 44100
}

TEST_CASE("a mass of a gram on 1000 N/m swings at 1000 rad/s", "[synth_a_modeler]") {
  const std::vector<double> y = rendered(
      "mass(0.001,0.0,1.0),m;\nground(0.0),g;\nlink(1000.0,0.0,0.0),l,m,g;\naudioout,a,m;\n",
      44100);
  // The sampled oscillation advances by 2 asin(sqrt(K/M)/2) per sample.
  const double theta = 2.0 * std::asin(0.5 * std::sqrt(1000.0 / 1944810.0));
  CHECK(std::fabs(theta * fs / (2.0 * std::numbers::pi) - 159.154943) < 0.004);
  CHECK(std::fabs(measured_hz(y, fs, 159.0) - theta * fs / (2.0 * std::numbers::pi)) < 1e-3);
  // A metre per second gives an amplitude of a millimetre.
  const double most = *std::max_element(y.begin(), y.end());
  CHECK(std::fabs(most - 1e-3) < 1e-6);
}

TEST_CASE("a link is at rest with its first end `offset` above the second", "[synth_a_modeler]") {
  for (const char* const ends : {"g,m", "m,g"}) {
    const std::vector<double> y =
        rendered(std::string("ground(0.0),g;\nmass(0.001,0.0,0.0),m;\nlink(1000.0,1.0,0.01),l,") +
                     ends + ";\naudioout,a,m;\n",
                 44100);
    CHECK(std::fabs(y.back() - (ends[0] == 'm' ? 0.01 : -0.01)) < 1e-9);
  }
}

TEST_CASE("a touch acts while its first end is more than `offset` above the second",
          "[synth_a_modeler]") {
  const std::string text =
      "port(),hand;\nground(0.0),g;\nmass(0.001,0.0,0.0),m;\nlink(500.0,1.0,0.0),l,m,g;\n"
      "touch(500.0,0.0,0.002),t,hand,m;\naudioout,a,m;\n";
  CHECK(rendered(text, 44100, 0.0019).back() == 0.0);
  CHECK(rendered(text, 44100, -0.01).back() == 0.0);
  // 500 (0.004 - 0.002 - x) = 500 x
  CHECK(std::fabs(rendered(text, 44100, 0.004).back() - 0.001) < 1e-9);
}

TEST_CASE("resonators are modes of one body at one place", "[synth_a_modeler]") {
  const Network network = network_of(
      "port(),hand;\nresonators(200.0,0.5,0.01, 330.5,0.25,0.04),r;\n"
      "touch(10.0,0.0,0.0),t,hand,r;\naudioout,a,r;\n");
  REQUIRE(network.modes.size() == 2);
  CHECK(value_of(network, network.macros[0].mass) == 19448100.0);
  CHECK(value_of(network, network.modes[0].frequency_hz) == 200.0);
  CHECK(value_of(network, network.modes[1].frequency_hz) == 330.5);
  // tau is the decay to 1/e; T60 is ln 1000 times as long.
  CHECK(std::fabs(value_of(network, network.modes[0].t60_s) - 0.5 * std::log(1000.0)) < 1e-12);
  CHECK(network.modes[0].shape == std::vector<double>{1.0});
  CHECK(network.modes[1].shape == std::vector<double>{0.5});  // sqrt(0.01/0.04)
}

TEST_CASE("waveguides between two terminations are joined", "[synth_a_modeler]") {
  const Network network = network_of(string_of_two);
  REQUIRE(network.macros.size() == 1);
  const Macro& w = network.macros[0];
  CHECK(w.name == "w0");
  CHECK(w.kind == MacroKind::waveguide);
  CHECK(value_of(network, w.impedance) == 22050.0);  // 0.5 * 44100
  CHECK(std::fabs(value_of(network, w.frequency_hz) - 200.0) < 1e-9);
  const double loss = -std::log(0.99 * 0.98);  // per period
  CHECK(std::fabs(value_of(network, w.t60_s) - std::log(1000.0) * 0.005 / loss) < 1e-9);
  CHECK(value_of(network, w.brightness) == 1.0);
  REQUIRE(!network.taps.empty());
  CHECK(std::fabs(value_of(network, network.taps[0].u) - 0.4) < 1e-12);
}

TEST_CASE("the frequency of a waveguide is one over the sum of its delays", "[synth_a_modeler]") {
  std::string text = string_of_two;
  text.replace(text.find("link(100.0,0.5"), 14, "touch(9.0,0.0");
  const Network network = expand_macros(network_of(text));
  Bare<double> bare(make_program(network, fs, true, schemes_of(network, Passivity::always).links));
  std::vector<double> y;
  for (std::size_t n = 0; n < 44100; ++n) {
    y.push_back(bare.step({n < 20 ? 0.01 : -1.0})[0]);  // a blow of half a millisecond
  }
  CHECK(std::fabs(measured_hz(y, fs, 200.0) - 200.0) < 0.05);
}

TEST_CASE("the filter of a termination adds delay and damps high partials", "[synth_a_modeler]") {
  const Network network = network_of(
      "faustcode: fc=5000.0;\nfaustcode: r=hslider(\"r\",-0.995,-1.0,0.0,0.001);\n"
      "port(),hand;\nlink(100.0,0.5,0.0),l,hand,j;\n"
      "waveguide(1.0,simpleString(0.02,0.004-simpleStringTermDelay(fc))),w0,a,j;\n"
      "waveguide(1.0,simpleString(0.02,0.006-simpleStringTermDelay(fc))),w1,b,j;\n"
      "termination(simpleStringTerm(r,fc)),a;\ntermination(simpleStringTerm(-0.995,fc)),b;\n"
      "junction(0.1),j;\naudioout,o,j;\n");
  const Macro& w = network.macros[0];
  CHECK(std::fabs(value_of(network, w.frequency_hz) - 100.0) < 1e-9);  // the delay is compensated
  CHECK(w.position == 0.1);
  const double flat = -2.0 * std::log(0.995);
  // A moving average of length 1/fc has the response sin(x)/x with x = pi f/fc: each end loses
  // x^2/6.
  const double mean = 2.0 / 6.0 * std::pow(std::numbers::pi * 100.0 / 5000.0, 2);
  CHECK(std::fabs(value_of(network, w.t60_s) / (std::log(1000.0) * 0.01 / (flat + mean)) - 1.0) <
        1e-9);
  CHECK(std::fabs(value_of(network, w.brightness) - flat / (flat + mean)) < 1e-9);
  std::string free = string_of_two;
  for (std::size_t at = free.find("(-0.9"); at != free.npos; at = free.find("(-0.9")) {
    free.erase(at + 1, 1);
  }
  CHECK(network_of(free).macros[0].kind == MacroKind::open_waveguide);
}

TEST_CASE("sliders and constants are parameters", "[synth_a_modeler]") {
  const Network network = network_of(whole);
  REQUIRE(network.parameters.size() == 1);
  CHECK(network.parameters[0].name == "stiff");
  CHECK(network.parameters[0].value == 400.0);
  for (const Link& link : network.links) {
    if (link.name.text() == "skin") {
      CHECK(argument_value(network, link.arguments[0], std::vector{300.0}) == 300.0);
    }
  }
  // (head - box*0.5)*stiff is one output of two, and the string is another.
  REQUIRE(network.outputs.size() == 3);
  CHECK(network.outputs[0].number == 1);
  CHECK(network.outputs[1].number == 1);
  CHECK(network.outputs[2].number == 2);
  CHECK(argument_value(network, network.outputs[0].level, std::vector{300.0}) == 300.0);
  CHECK(argument_value(network, network.outputs[1].level, std::vector{300.0}) == -150.0);
  const ParsedNetwork printed = parse_network(print_network(network));
  CHECK(printed.ok());
  CHECK(printed.network == network);
}

TEST_CASE("errors in Synth-A-Modeler files have a line", "[synth_a_modeler]") {
  check_error("mass(1.0,0.0,0.0,0.0),m;\n", 1, 1, "expected mass(m,x0,v0),id;, found 4 arguments");
  check_error("mass(1.0,0.0,0.0),m\n", 1, 20, "the line ends where a ';' was expected");
  check_error("# a\n\nmass(1.0,0.0,0.0,m;\n", 3, 5, "this ( is never closed");
  check_error("port(),p;\nmas(1.0,0.0,0.0),m;\n", 2, 1,
              "expected an element of Synth-A-Modeler, found 'mas'; did you mean 'mass'?");
  check_error("mass(1.0,0.0,0.0),m;\nlink(1.0,0.0,0.0),l,m,n;\n", 2, 23,
              "there is no element called 'n'; did you mean 'm'?");
  check_error("ground(0.0),g;\nground(0.0),g;\n", 2, 13, "'g' is already declared in line 1");
  check_error("faustcode: eq=highpass(4,20.0);\nmass(eq,0.0,0.0),m;\n", 1, 15,
              "found 'highpass' where a number, a slider or a constant was expected; other FAUST "
              "code is not supported");
  check_error("faustcode: a=b*2.0;\nfaustcode: b=a+1.0;\nmass(a,0.0,0.0),m;\n", 2, 14,
              "'a' is defined in terms of itself");
  std::string odd = string_of_two;
  odd.replace(odd.find("w1,j,fret"), 9, "w1,j,j");
  CHECK_FALSE(parse_network(odd).ok());
  check_error(
      "waveguide(0.5,simpleString(0.02,0.002)),w,j,j;\njunction(0.0),j;\naudioout,a,j;\n", 1, 1,
      "this waveguide reaches no termination: it is in a ring, or between two junctions that do "
      "not join two waveguides of one impedance");
}

TEST_CASE("approximate translations cause a warning", "[synth_a_modeler]") {
  // Messages about the translation have the line of the source.
  check_warning(
      "port(),p;\nmass(1.0,0.0,0.0),m;\nlink(1.0,0.0,0.0),l,m,p;\n"
      "\n  ground(0.0),g;\naudioout,a,m;\n",
      5, 3, "nothing is attached to '@g'");
  const Network pluck = network_of(
      "port(),p;\nmass(1.0,0.0,0.0),m;\npluck(9.0,0.0,0.006,0.0),l,m,p;\naudioout,a,m;\n");
  REQUIRE(pluck.links.size() == 1);
  CHECK(pluck.links[0].law == Law::pluck);
  // The maximum force is 0.09 K SCALE here, and k halfWidth in Synth-A-Modeler.
  CHECK(std::fabs(0.09 * value_of(pluck, pluck.links[0].arguments[0]) - 9.0) < 1e-12);
  CHECK(value_of(pluck, pluck.links[0].arguments[1]) == 0.006);
}

TEST_CASE("output expressions are translated", "[synth_a_modeler]") {
  // Expected values for a = 1, b = 2.
  const auto levels = [](const std::string& heard) {
    const Network network = network_of(
        "faustcode: s=hslider(\"\",3,0,9,1);\nport(),p;\nmass(1.0,0.0,0.0),a;\n"
        "mass(1.0,0.0,0.0),b;\nlink(1.0,0.0,0.0),l,a,p;\nlink(1.0,0.0,0.0),k,b,p;\n"
        "audioout,o," +
        heard + ";\n");
    double sum = 0.0;
    for (const Output& output : network.outputs) {
      CHECK(output.number == 1);
      const double level = output.level == no_argument
                               ? 1.0
                               : argument_value(network, output.level, std::vector{3.0});
      sum += level * (network.masses[output.mass].name.text() == "a" ? 1.0 : 2.0);
    }
    return sum;
  };
  CHECK(levels("a") == 1.0);
  CHECK(levels("5.0e-1*b") == 1.0);
  CHECK(levels("a+b") == 3.0);
  CHECK(levels("a-b") == -1.0);
  CHECK(levels("a-b-b") == -3.0);
  CHECK(levels("-a+b") == 1.0);
  CHECK(levels("-(a-b)*2.0") == 2.0);
  CHECK(levels("a*s/2.0 + b/s*3.0") == 3.5);
  CHECK(levels("(1.0+2.0)*(a+b*(s-1.0))") == 15.0);
  CHECK(levels("2.0*-a+b") == 0.0);
  CHECK(levels("a+a") == 2.0);
  CHECK(levels("(1.0+a)*2.0-2.0") == 2.0);
  CHECK(levels("a:*(4.0):_") == 4.0);
  CHECK(levels("a*(2.0):+(0.0):*(s)+b") == 8.0);
  CHECK(levels("a*2.0^s") == 8.0);
  check_error("port(),p;\naudioout,a,p*p;\n", 2, 13,
              "a signal may be multiplied by numbers, not by another signal");
}

TEST_CASE("files in our own language are not translated", "[synth_a_modeler]") {
  CHECK(network_of("# mass(1.0,0.0,0.0),m;\n@m osc 1. 0.1 0. 0. 0.\n@out1 posOutput @m\n")
            .masses.size() == 1);
  CHECK(parse_network("mass of a note\n@m osc 1. 0.1 0. 0. 0.\n@out1 posOutput @m\n").ok());
}

TEST_CASE("an element may have the name of a channel", "[synth_a_modeler]") {
  const Network network = network_of(
      "mass(1.0,0.0,0.0),in1;\nmass(1.0,0.0,0.0),in1_;\nport(),q;\nlink(1.0,0.0,0.0),out1,in1,q;\n"
      "link(1.0,0.0,0.0),l,in1_,in1;\naudioout,a,in1;\n");
  CHECK(network.masses[network.outputs[0].mass].name.text() == "in1__");
  CHECK(network.links[0].name.text() == "out1_");
}

TEST_CASE("damaged texts do not crash the translator", "[synth_a_modeler]") {
  const std::string pieces[] = {"(",
                                ")",
                                ",",
                                ";",
                                "\n",
                                "\"",
                                "#",
                                "-",
                                "0.0",
                                "j",
                                "stiff",
                                "half",
                                "simpleString(",
                                "link",
                                "1e308",
                                "=",
                                "faustcode: ",
                                "*"};
  Random random(7);
  int read = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string text = whole;
    for (std::size_t times = 1 + random.below(4); times > 0; --times) {
      const std::size_t at = random.below(text.size());
      switch (random.below(4)) {
        case 0:
          text.erase(at, 1 + random.below(20));
          break;
        case 1:
          text.insert(at, pieces[random.below(std::size(pieces))]);
          break;
        case 2:
          text[at] = static_cast<char>(1 + random.below(255));
          break;
        default:
          text.insert(at, text.substr(random.below(text.size()), random.below(60)));
          break;
      }
    }
    const ParsedNetwork parsed = parse_network(text);
    const auto lines = static_cast<int>(std::count(text.begin(), text.end(), '\n')) +
                       static_cast<int>(std::count(text.begin(), text.end(), '\r'));
    for (const Diagnostic& diagnostic : parsed.diagnostics) {
      REQUIRE(diagnostic.line >= 1);
      REQUIRE(diagnostic.line <= lines + 1);
      REQUIRE(diagnostic.column >= 1);
    }
    read += parsed.ok() ? 1 : 0;
    if (parsed.ok()) {
      (void)compile_network(parsed.network, Preset{}, {.rate_hz = fs});
    }
  }
  CHECK(read > 20);
  CHECK(read < 1900);
  for (const std::string& nest :
       {std::string(100000, '('), std::string(100000, '-'), std::string(100000, ')')}) {
    CHECK_FALSE(parse_network("mass(" + nest + ",0.0,0.0),m;\n").ok());
    CHECK_FALSE(parse_network("port(),p;\naudioout,a," + nest + "q;\n").ok());
  }
  std::string doubling = "faustcode: x0=y;\nfaustcode: y=hslider(\"\",1,0,1,1);\n";
  for (int i = 1; i < 45; ++i) {
    const std::string before = "x" + std::to_string(i - 1);
    doubling += "faustcode: x" + std::to_string(i) + "=" + before + "+" + before + ";\n";
  }
  // An expression that is too long keeps its value at the start.
  const Network doubled = network_of(doubling + "mass(x44,0.0,0.0),m;\naudioout,a,m;\n");
  CHECK(value_of(doubled, doubled.masses[0].mass) == std::ldexp(1944810000.0, 44));
}

}  // namespace ressort::synth_a_modeler_test
