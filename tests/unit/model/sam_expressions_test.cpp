// FAUST code in Synth-A-Modeler's models: filters, sliders, tables, links as outputs, and junctions
// of any number of waveguides.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"
#include "tests/support/passive.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::sam_expressions_test {
namespace {

using namespace support;
using messages::check_error;

constexpr double fs = 44100.0;

// Returns all outputs with a constant position of the hand.
std::vector<std::vector<double>> rendered(const std::string& text, std::size_t frames,
                                          double hand = 0.0) {
  Player player(text, default_preset(network_of(text), true), {.bare = true});
  const std::vector<double> place(frames, hand);
  const std::vector<const double*> inputs(player.compiled.instrument.inputs.size(), place.data());
  player.run(frames, {}, {256}, inputs);
  return player.out;
}

// Returns the initial value of the level of output 1 of a mass 'm'.
double level_of(const std::string& definitions, const std::string& level) {
  const Network network = network_of(definitions +
                                     "ground(0.0),g;\nmass(1.0,0.0,0.0),m;\n"
                                     "link(1.0,0.0,0.0),l,m,g;\naudioout,a,m*(" +
                                     level + ");\n");
  return level_value(network, network.outputs[0], parameter_values(network));
}

std::vector<std::string> warnings_of(const std::string& text) {
  std::vector<std::string> warnings;
  for (const Diagnostic& diagnostic : parse_network(text).diagnostics) {
    INFO(diagnostic.message);
    REQUIRE(diagnostic.severity == Severity::warning);
    warnings.push_back(std::to_string(diagnostic.line) + ":" + std::to_string(diagnostic.column) +
                       ": " + diagnostic.message);
  }
  return warnings;
}

const std::string drum =
    "mass(0.001,0.0,0.0),head;\nground(0.0),rim;\nlink(400.0,0.5,0.0),skin,head,rim;\n";

}  // namespace

// The scheme of Synth-A-Modeler: forces from the positions one sample before and their differences,
// then x += v with v += f/(m fs^2).
TEST_CASE("masses, links and their forces agree with the scheme of Synth-A-Modeler",
          "[sam_expressions]") {
  const auto y = rendered(
      "faustcode: k=hslider(\"k\",2200.0,500.0,4000.0,100.0);\n"
      "mass(0.01,0.0,0.2),a;\nmass(0.03,0.0,-0.3),b;\nground(0.0),g;\n"
      "link(2.0*k,0.003,0.0),l1,a,b;\nlink(k,0.02,0.0),l2,b,g;\n"
      "audioout,o1,a*(1000.0)+l1*(100.0);\naudioout,o2,l2*(-50.0)+l1*(0.01);\n",
      2000);
  double a = 0.0;
  double b = 0.0;
  double va = 0.2 / fs;
  double vb = -0.3 / fs;
  double before1 = 0.0;
  double before2 = 0.0;
  double worst = 0.0;
  double most = 0.0;
  for (std::size_t n = 0; n < y[0].size(); ++n) {
    const double l1 = 4400.0 * (a - b) + 0.003 * fs * (a - b - before1);
    const double l2 = 2200.0 * b + 0.02 * fs * (b - before2);
    before1 = a - b;
    before2 = b;
    va -= n == 0 ? 0.0 : l1 / (0.01 * fs * fs);
    vb += n == 0 ? 0.0 : (l1 - l2) / (0.03 * fs * fs);
    a += va;
    b += vb;
    if (n > 1) {  // the motion before the first sample is not the same
      const double first = 1000.0 * a + 100.0 * l1;
      worst = std::max(
          {worst, std::fabs(y[0][n] - first), std::fabs(y[1][n] - (-50.0 * l2 + 0.01 * l1))});
      most = std::max(most, std::fabs(first));
    }
  }
  CHECK(most > 1.0);
  CHECK(worst < 1e-9 * most);
}

TEST_CASE("the force of a touch is heard at an end of its own", "[sam_expressions]") {
  const std::string text = drum + "port(),hand;\ntouch(500.0,0.0,0.002),hit,hand,head;\n";
  // 400 x = 500 (0.004 - x - 0.002) at rest.
  const auto y = rendered(text + "audioout,a,hit;\naudioout,b,skin;\n", 44100, 0.004);
  CHECK(std::fabs(y[0].back() - 400.0 / 900.0) < 1e-6);
  CHECK(std::fabs(y[1].back() - y[0].back()) < 1e-6);
  const auto warnings = warnings_of(drum +
                                    "mass(0.001,0.0,0.0),box;\nlink(9.0,0.0,0.0),foot,box,rim;\n"
                                    "touch(500.0,0.0,0.002),hit,box,head;\naudioout,a,hit;\n");
  CHECK(std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
    return warning.find("6:24: left out of the outputs: the force of 'hit'") == 0;
  }));
}

TEST_CASE("FAUST expressions of numbers have their value", "[sam_expressions]") {
  const std::string sliders =
      "faustcode: note=hslider(\"Note\",57.0,least,90.0,1.0);\nfaustcode: least=20.0;\n"
      "faustcode: half=0.5*vslider(\"Half\",3.0,0.0,9.0,0.1) : smooth(0.999);\n"
      "faustcode: place=int(nentry(\"Place\",2,0,4,1));\n"
      "faustcode: key = _:-(69.0):/(12.0) <: (2.0,_) : pow : *(440.0) : _;\n"
      "faustcode: one = *(0.0):+(1.0);\nfaustcode: entries=(4,0,-1,7.5,7.5);\n"
      "faustcode: pick(list)=rdtable(5, mytake(presetInitIndex,5,list),place);\n";
  const struct {
    const char* level;
    double value;
  } cases[] = {{"note:mtof", 220.0},
               {"key(note)", 220.0},
               {"key(note+12.0)*2.0", 880.0},
               {"half", 1.5},
               {"one(note)", 1.0},
               {"(-20.0):db2linear", 0.1},
               {"ba.db2linear(20.0)", 10.0},
               {"2.0^3*half", 12.0},
               {"(10.0,((note-60.0):float)):pow:-(1.0):*(-1.0)", 0.999},
               {"pick(entries)", -1.0},
               {"hslider(\"In place\",2.5,0,9,1)*2", 5.0},
               {"1.0-simpleStringTermDelay(1000.0)", 0.9995}};
  for (const auto& [level, value] : cases) {
    INFO(level);
    CHECK(std::fabs(level_of(sliders, level) - value) < 1e-12);
  }
  // A table follows its slider, and is level beyond its ends.
  const Network network = network_of(sliders + drum + "audioout,a,head*pick(entries);\n");
  std::vector<double> values = parameter_values(network);
  const auto place = std::find_if(network.parameters.begin(), network.parameters.end(),
                                  [](const Parameter& p) { return p.name == "place"; });
  REQUIRE(place != network.parameters.end());
  double& slot = values[static_cast<std::size_t>(place - network.parameters.begin())];
  const double expected[] = {4.0, 4.0, 0.0, -1.0, 7.5, 7.5, 7.5};
  for (int i = -1; i <= 5; ++i) {
    slot = i;
    CHECK(std::fabs(level_value(network, network.outputs[0], values) - expected[i + 1]) < 1e-12);
  }
}

TEST_CASE("a constant output is silent, and a definition without use is no error",
          "[sam_expressions]") {
  const auto y = rendered("faustcode: low=highpass(4,20.0);\nfaustcode: noise=fancy(x) ~ _;\n" +
                              drum + "audioout,a0,0.0;\naudioout,a1,head+0.25;\n",
                          3);
  CHECK(y[0].back() == 0.0);
  CHECK(y[1].back() == 0.25);
}

TEST_CASE("what is left out of an output causes one warning", "[sam_expressions]") {
  const auto warnings = warnings_of("faustcode: room=reverb(0.3);\n" + drum +
                                    "audioout,a,head:room:room;\naudioout,b,head*2.0:room;\n");
  REQUIRE(warnings.size() >= 1);
  CHECK(std::count_if(warnings.begin(), warnings.end(), [](const std::string& warning) {
          return warning.find("left out") != std::string::npos;
        }) == 1);
  CHECK(warnings[0] == "1:17: left out: 'reverb' is not supported");
}

// FAUST's filters, as their recursions: smooth and dcblocker as they are written there, lowpass and
// highpass by the bilinear transform of 1/(1+s) and of 1/(1+a s+s^2), or of s and s^2 above these.
TEST_CASE("filters behind an output agree with FAUST's recursions", "[sam_expressions]") {
  using Row = std::vector<double>;
  const auto run = [](const Row& x, double b0, double b1, double b2, double a1, double a2) {
    Row y;
    for (std::size_t n = 0; n < x.size(); ++n) {
      const auto before = [n](const Row& of, std::size_t d) { return n < d ? 0.0 : of[n - d]; };
      y.push_back(b0 * x[n] + b1 * before(x, 1) + b2 * before(x, 2) - a1 * before(y, 1) -
                  a2 * before(y, 2));
    }
    return y;
  };
  const auto first = [&](const Row& x, double hz, double s) {
    const double c = 1.0 / std::tan(std::numbers::pi * hz / fs);
    return run(x, (1.0 - s + s * c) / (1.0 + c), (1.0 - s - s * c) / (1.0 + c), 0.0,
               (1.0 - c) / (1.0 + c), 0.0);
  };
  const auto second = [&](const Row& x, double hz, double s, double a) {
    const double c = 1.0 / std::tan(std::numbers::pi * hz / fs);
    const double d = 1.0 + a * c + c * c;
    const double top = (s == 0.0 ? 1.0 : c * c) / d;
    return run(x, top, (s == 0.0 ? 2.0 : -2.0) * top, top, 2.0 * (1.0 - c * c) / d,
               (1.0 - a * c + c * c) / d);
  };
  const std::string text =
      "faustcode: low=highpass(4,20.0);\n"
      "faustcode: cut=hslider(\"Cut\",900.0,100.0,5000.0,1.0);\n" +
      drum + "mass(0.002,0.0,-0.7),tail;\nlink(900.0,0.02,0.0),l,tail,rim;\n";
  const std::string moving = "mass(0.003,0.0,1.0),bell;\nlink(2000.0,0.01,0.0),b,bell,head;\n";
  const Row plain = rendered(text + moving + "audioout,a,bell*(2.0)-tail;\n", 8000)[0];
  const double pairs[] = {2.0 * std::cos(std::numbers::pi / 8.0),
                          2.0 * std::cos(3.0 * std::numbers::pi / 8.0)};
  const struct {
    const char* filter;
    Row expected;
  } cases[] = {
      {"smooth(0.99)", run(plain, 0.01, 0.0, 0.0, -0.99, 0.0)},
      {"si.smoo", run(plain, 0.001, 0.0, 0.0, -0.999, 0.0)},
      {"smooth(tau2pole(0.01))",
       run(plain, 1.0 - std::exp(-1.0 / 441.0), 0.0, 0.0, -std::exp(-1.0 / 441.0), 0.0)},
      {"dcblocker", run(plain, 1.0, -1.0, 0.0, -0.995, 0.0)},
      {"*(0.5):lowpass(1,cut)*2.0", first(plain, 900.0, 0.0)},
      {"fi.highpass(1,300.0)", first(plain, 300.0, 1.0)},
      {"low", second(second(plain, 20.0, 1.0, pairs[0]), 20.0, 1.0, pairs[1])},
      {"lowpass(2,cut*10.0)", second(plain, 9000.0, 0.0, std::numbers::sqrt2)},
      {"lowpass(3,cut)", first(second(plain, 900.0, 0.0, 1.0), 900.0, 0.0)},
      {"highpass(2,100.0):lowpass(1,cut)",
       first(second(plain, 100.0, 1.0, std::numbers::sqrt2), 900.0, 0.0)},
  };
  for (const auto& [filter, expected] : cases) {
    const Row y =
        rendered(text + moving + "audioout,a,(bell*(2.0)-tail):" + filter + ";\n", 8000)[0];
    double worst = 0.0;
    double most = 0.0;
    for (std::size_t n = 0; n < y.size(); ++n) {
      worst = std::max(worst, std::fabs(y[n] - expected[n]));
      most = std::max(most, std::fabs(expected[n]));
    }
    INFO(filter << ": " << worst / most);
    CHECK(most > 1e-6);
    CHECK(worst < 1e-9 * most);
  }
}

TEST_CASE("the mass of a filter has a name of its own", "[sam_expressions]") {
  const Network network = network_of(
      "mass(0.001,0.0,0.0),filter1;\nground(0.0),rim;\n"
      "link(400.0,0.5,0.0),filter1_link,filter1,rim;\naudioout,a,filter1:smooth(0.9);\n");
  REQUIRE(network.links.size() == 2);
  CHECK(network.links[0].name.text() != network.links[1].name.text());
}

TEST_CASE("a filter that cannot be computed is left out with its reason", "[sam_expressions]") {
  const std::string fourth = drum + "audioout,a,head:lowpass(1,99.0):lowpass(6,99.0);\n";
  CHECK(warnings_of(fourth)[0] ==
        "4:33: left out: 'lowpass' follows positions only, and at most three in a row");
  for (const char* const filter : {"lowpass(2)", "lowpass(0,99.0)", "highpass(7,99.0)",
                                   "highpass(1.5,99.0)", "lowpass(1,0.0)", "lowpass(1,22050.0)"}) {
    INFO(filter);
    CHECK(warnings_of(drum + "audioout,a,head:" + filter + ";\n")[0].find("4:17: left out") == 0);
  }
}

// Strings of one impedance, fixed at one end and tied at the other, resonate where the sum of
// cot(pi f T) is 0, with T the time from the knot to the fixed end and back.
TEST_CASE("a junction may join any number of waveguides", "[sam_expressions]") {
  const double times[] = {0.0050, 0.0041, 0.0057, 0.0046, 0.0035};
  for (const int count : {1, 3, 5}) {
    std::string text = "port(),hand;\ntouch(9.0,0.0,0.0),hit,hand,j;\njunction(0.0),j;\n";
    for (int i = 0; i < count; ++i) {
      const std::string n = std::to_string(i);
      text += "waveguide(0.5,simpleString(0.02," + std::to_string(times[i]) + ")),w" + n + ",t" +
              n + ",j;\ntermination(memorylessStringTerm(-0.995)),t" + n + ";\n";
    }
    text += "audioout,a,j;\n";
    double low = 20.0;  // the sum falls from here to the first zero
    double high = 170.0;
    while (high - low > 1e-9) {
      const double middle = 0.5 * (low + high);
      double sum = 0.0;
      for (int i = 0; i < count; ++i) {
        sum += 1.0 / std::tan(std::numbers::pi * middle * times[i]);
      }
      (sum > 0.0 ? low : high) = middle;
    }
    const Network network = expand_macros(network_of(text));
    Bare<double> bare(
        make_program(network, fs, true, schemes_of(network, Passivity::always).links));
    std::vector<double> y;
    for (std::size_t n = 0; n < 44100; ++n) {
      y.push_back(bare.step({n < 60 ? 0.01 : -1.0})[0]);
    }
    INFO(count << " waveguides: " << low << " Hz");
    CHECK(std::fabs(measured_hz(y, fs, low) / low - 1.0) < 5e-4);
  }
}

TEST_CASE("a junction without waveguides is left out", "[sam_expressions]") {
  const auto warnings = warnings_of(drum + "junction(0.0),j;\naudioout,a,head;\n");
  CHECK(warnings[0] == "4:15: left out: 'j' joins no waveguide");
}

// A pluck with an offset pushes the string when the hand is near that offset, not near 0.
TEST_CASE("a pluck acts around its offset", "[sam_expressions]") {
  for (const char* const ends : {"head,hand", "hand,head"}) {
    // The first end is the offset above the second.
    const double place = ends[1] == 'e' ? -0.01 : 0.01;
    const std::string text =
        drum + "port(),hand;\npluck(500.0,0.0,0.002,0.01),pick," + ends + ";\naudioout,a,head;\n";
    INFO(ends);
    CHECK(std::fabs(rendered(text, 22050)[0].back()) < 1e-9);
    const double pushed = rendered(text, 22050, place + 0.0005)[0].back();
    CHECK(pushed < -1e-5);  // the hand is above the string
    CHECK(std::fabs(rendered(text, 22050, place - 0.0005)[0].back() + pushed) <
          1e-6 * std::fabs(pushed));
  }
}

// Models in the style of the published ones: each way to write an output, with each excitation.
TEST_CASE("models in the style of the published ones are read", "[sam_expressions]") {
  const std::string definitions =
      "# Example MDL file\n\nfaustcode:vol=hslider(\"Ze Volume\",-12.0,-40.0,40.0,1.0) : db2linear "
      ": onePoleBLT(2.0); // smooth\nfaustcode: outputDSP=highpass(4,20.0);\n"
      "faustcode: m=hslider(\"Mass [kg]\", 0.01, 0.0005, 0.1, 0.0005);\nfaustcode:// a comment\n";
  const std::string exciters[] = {
      "touch(100.0,0.03,0.0),p,dev1,r;\n", "pluck(140.0*1.0,0.35,0.005,0.01),p,dev1,r;\n",
      "pluck(600.0,0.07,0.007,0.0),p,r,dev1;\n", "link(50.0,0.1,0.0),p,r,dev1,(label);\n",
      "pulseTouch(100.0,0.1,0.0,4.0,0.012,0.006),p,dev1,r;\n"};
  const std::string bodies[] = {
      "mass(m*1.0),r,(mymass);\nground(),g;\nlink(600.0,0.01,0.0),l,r,g;\n",
      "resonators(200.0,0.3,m,410.0,0.2,m*2.0),r;\n",
      "termination(simpleStringTerm(-0.994,5000.0)),r0;\njunction(0.0),r;\n"
      "waveguide(0.5,simpleString(0.01,0.01)),w,r0,r;\n"};
  const std::string outputs[] = {
      "r*vol:outputDSP", "(r*(1000.0)):highpass(3,30.0):defaultOutputDSP",
      "r:*(vol):highpass(1,2000.0)*(2.0)*vol", "p*vol*0.10", "1.0*(r*(100.0)+p*0.5)"};
  int read = 0;
  for (const std::string& body : bodies) {
    for (const std::string& exciter : exciters) {
      for (const std::string& output : outputs) {
        const std::string text = definitions + body + "port( ),dev1; # pos 43,285\nport(),dev2;\n" +
                                 exciter + "audioout,a0," + output +
                                 "; # pos 1,2\naudioout,a1,0.0;";
        const ParsedNetwork parsed = parse_network(text);
        INFO(text << (parsed.diagnostics.empty() ? "" : parsed.diagnostics.front().message));
        REQUIRE(parsed.ok());
        CHECK(parsed.network.outputs.back().number == 2);
        ++read;
      }
    }
  }
  CHECK(read == 75);
}

// The classes of files that are published, each with three values. Masses swing at the frequency of
// their spring, and strings resonate at 1/T, or at half of it where one end is free to move.
TEST_CASE("models of each published class sound at their frequency", "[sam_expressions]") {
  const auto number = [](double value) { return std::to_string(value); };
  int models = 0;
  for (const double k : {350.0, 1200.0, 4000.0}) {
    const double mass_hz =
        fs / std::numbers::pi * std::asin(0.5 * std::sqrt(k / (0.001 * fs * fs)));
    const std::string mass = "mass(0.001,0.0,1.0),r;\nground(0.0),g;\n";
    const std::string link = mass + "link(" + number(k) + ",0.0001,0.0),l,r,g;\n";
    const std::string hand = "port(),hand;\nport(),device2;\n";
    const double string_s = std::round(6e5 / k) * 1e-6;  // as it is written
    const auto string = [&](int junctions) {
      std::string text = hand + "touch(9.0,0.0,0.0),hit,hand,j;\njunction(0.0),j;\n";
      for (int i = 0; i < junctions; ++i) {
        const std::string n = std::to_string(i);
        text += "waveguide(0.5,simpleString(0.02," + number(string_s) + ")),w" + n + ",t" + n +
                ",j;\ntermination(memorylessStringTerm(-0.995)),t" + n + ";\n";
      }
      return text + "audioout,a0,j;\n";
    };
    const double pair = std::sqrt((3.0 + std::sqrt(5.0)) / 2.0);  // two equal masses, one fixed end
    const struct {
      const char* style;
      std::string text;
      double hz;
    } cases[] = {
        {"a filter defined and not used",
         "faustcode: low=highpass(4,20.0);\n" + link + "audioout,a0,r;\n", mass_hz},
        {"a filter defined and used",
         "faustcode: low=highpass(4,20.0);\n" + link + "audioout,a0,r*(30.0):low;\n", mass_hz},
        {"FAUST behind an output", link + "audioout,a0,r*(100.0):highpass(1,2000.0):*(2.0);\n",
         mass_hz},
        {"the force of a link", link + "audioout,a0,l*0.01;\n", mass_hz},
        {"a port beside a mass", hand + link + "audioout,a0,1.0*(r*(100.0)+hand*0.5);\n", mass_hz},
        {"a smoothed slider",
         "faustcode: k=hslider(\"K\"," + number(k) + ",50,9999,1):smooth(0.999);\n" + mass +
             "link(k,0.0001,0.0),l,r,g;\naudioout,a0,r;\n",
         mass_hz},
        {"a constant output", link + "audioout,a1,0.0;\naudioout,a0,r;\n", mass_hz},
        {"a pluck with an offset",
         hand + link + "pluck(500.0,0.1,0.002,0.5),p,r,hand;\naudioout,a0,r;\n", mass_hz},
        {"a pulseTouch",
         hand + link + "pulseTouch(100.0,0.1,1.0,4.0,0.01,0.006),p,hand,r;\naudioout,a0,r;\n",
         mass_hz},
        {"masses in a row",
         link + "mass(0.001,0.0,-0.618),s;\nlink(" + number(k) +
             ",0.0001,0.0),m,r,s;\naudioout,a0,r;\n",
         fs / std::numbers::pi * std::asin(0.5 * pair * std::sqrt(k / (0.001 * fs * fs)))},
        {"resonators",
         hand + "resonators(" + number(k) + ",0.05,0.01, " + number(2.7 * k) +
             ",0.01,9.0),r;\ntouch(9.0,0.0,0.0),hit,hand,r;\naudioout,a0,r;\n",
         k},
        {"a junction of one waveguide", string(1), 0.5 / string_s},
        {"a junction of three waveguides", string(3), 0.5 / string_s},
        {"a junction of five waveguides", string(5), 0.5 / string_s},
    };
    for (const auto& [style, text, hz] : cases) {
      INFO(style << ", " << hz << " Hz\n" << text);
      Player player(text, default_preset(network_of(text), true), {.bare = true});
      std::vector<double> touch(11025, -1.0);
      std::fill(touch.begin(), touch.begin() + 60, 0.01);
      const std::vector<const double*> inputs(player.compiled.instrument.inputs.size(),
                                              touch.data());
      player.run(touch.size(), {}, {256}, inputs);
      CHECK(std::fabs(measured_hz(player.out.back(), fs, hz, 0.01) / hz - 1.0) < 2e-3);
      ++models;
    }
  }
  CHECK(models == 42);
}

}  // namespace ressort::sam_expressions_test
