// Linear cases at the limits of stability, each compared with the plain scheme, which diverges: a
// shrinking mass, unequal masses, and invalid input of all kinds. stability_test covers T1 and most
// limits.
#include "app/realtime/process.h"
#include "core/analysis/stability.h"
#include "tests/support/player.h"

namespace ressort::stress_linear_test {
namespace {

using namespace support;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

// Returns the growth of a network after an impulse, with one parameter at a value, in the plain
// scheme.
double growth(const std::string& text, const std::string& name, double value, int steps) {
  const Network network = network_of(text);
  Program program = make_program(network, 44100.0, true);
  for (std::size_t i = 0; i < program.moving; ++i) {
    program.velocity[i] = std::cos(3.0 * static_cast<double>(i));
  }
  for (std::size_t i = 0; i < network.parameters.size(); ++i) {
    if (network.parameters[i].name == name) {
      program.parameters[i] = value;
    }
  }
  Bare<double> bare(program);
  double largest = 0.0;
  for (int n = 0; n < steps && largest < 1e12; ++n) {
    for (const double y : bare.step({})) {
      largest = std::max(largest, std::fabs(y));
    }
  }
  return largest;
}

SafeRange range_of(const std::string& text, const std::string& name) {
  const Network network = network_of(text);
  const std::vector<double> values = parameter_values(network);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (network.parameters[i].name == name) {
      const auto range = Stability(network, 1.0).safe_range({values, values}, i, values[i]);
      REQUIRE(range);
      return *range;
    }
  }
  FAIL("there is no parameter " + name);
  return {};
}

std::string with_masses(std::string text) {
  for (std::size_t at = 0; (at = text.find("mass 1.", at)) != text.npos;) {
    text.replace(at, 7, "mass m_M");
  }
  return "@m_M param 1.\n" + text;
}

// Checks that the network stays bounded up to the limit and diverges 1e-4 beyond it.
void check_around(const std::string& text, const std::string& name, double limit, bool is_upper,
                  int steps) {
  const SafeRange range = range_of(text, name);
  const double found = is_upper ? range.highest : range.lowest;
  INFO(name << ": " << show(found) << ", in theory " << show(limit));
  CHECK(found == Approx(limit).epsilon(1e-9));
  const double inwards = is_upper ? 1.0 - 1e-4 : 1.0 + 1e-4;
  CHECK(growth(text, name, limit * inwards, steps) < 1e5);
  CHECK(growth(text, name, limit / inwards, 4 * steps) > 1e10);
}

}  // namespace

TEST_CASE("T2: each stability limit matches theory, and simulations beyond it diverge",
          "[stress_linear]") {
  const std::string triangle = scenes::triangle("0.1", "0.001") + scenes::output(1, "m_m2");
  check_around(triangle, "m_K", 1.31568650461023, true, 100000);
  check_around(triangle, "m_Z", 0.608843252305113, true, 100000);
  check_around(with_masses(triangle), "m_M", 0.0889851164104615, false, 100000);
  const std::string bowed = scenes::string("s", 150, "0.3", "0.001") + scenes::output(1, "s_m70");
  check_around(bowed, "s_K", 0.998108222407659, true, 100000);
  check_around(bowed, "s_Z", 0.350054111203829, true, 100000);
  const auto top = [](double count) {
    return 4.0 * std::pow(std::cos(std::numbers::pi / count), 2);
  };
  check_around("@K param 0.1\n@d mesh 20 30 1. K 0.01 0. 0.\n@out1 posOutput [@d 0. 0.]\n", "K",
               4.0 / (top(40.0) + top(60.0)) - 0.02, true, 20000);
}

TEST_CASE("S13: a shrinking mass is limited for stability; the plain scheme diverges",
          "[stress_linear]") {
  const std::string text =
      "@M param 1.\n@o osc M 0.1 0.001 1. 1.\n@in1 frcInput @o\n" + scenes::output(1, "o");
  constexpr std::size_t ramp = 22050;
  std::vector<Event> events;
  for (std::size_t n = 0; n < ramp; ++n) {
    const double mass = 1.0 - 0.98 * static_cast<double>(n) / static_cast<double>(ramp);
    events.push_back(parameter(static_cast<std::uint32_t>(n), 0, mass));
  }
  const Network network = network_of(text);
  const Preset bare = default_preset(network, true);
  Player plain(text, bare, {.bare = true, .force = true});
  plain.run(ramp, events);
  const auto loud = std::find_if(plain.y().begin(), plain.y().end(),
                                 [](double y) { return std::fabs(y) > 10.0; });
  CHECK(loud - plain.y().begin() == Approx(22013).margin(2));
  // (K + 2Z)/4 = 0.0255.
  Player kept(text, bare, {.bare = true, .reach = {{"M", 0.02}}});
  CHECK(kept.compiled.instrument.parameters[0].minimum == 0.0255001);
  kept.run(ramp, events);
  kept.run(44100, {});
  CHECK(kept.engine().parameter(0) == 0.0255001);
  CHECK(kept.engine().meters().beyond > 100);
  CHECK(kept.engine().meters().resets == 0);
  CHECK(peak(kept.y()) < 10.0);
}

TEST_CASE("S22: a light mass on a heavy one is stable up to its limit", "[stress_linear]") {
  const std::string text =
      "@k param 0.001\n@g ground 0.\n@a mass 1. 0. 0.\n@b mass 0.001 0. 0.\n"
      "@r spring @g @a 0.01\n@l spring @a @b k\n" +
      scenes::output(1, "b");
  const double limit = 0.01596 / 3.994;
  CHECK(limit == Approx(0.003995994).epsilon(1e-7));
  CHECK(range_of(text, "k").highest == Approx(limit).epsilon(1e-9));
  CHECK(growth(text, "k", 0.00399, 100000) < 1e4);
  CHECK(growth(text, "k", 0.004, 100000) > 1e10);
  // A bound by rows would be half as large: k (1/.001 + 1/.001) < 4.
  const auto verdict = [&](double k) {
    const Network network = network_of(text);
    const auto compiled = compile_network(network, default_preset(network, true),
                                          {.bare = true, .settings = {{"k", k}}});
    REQUIRE(compiled);
    return compiled->stability.verdict;
  };
  CHECK(verdict(0.002) == Verdict::stable);
  CHECK(verdict(limit * (1.0 - 1e-6)) == Verdict::stable);
  CHECK(verdict(limit * (1.0 + 1e-6)) == Verdict::unstable);
}

// --- S25: invalid input --------------------------------------------------------------------------

TEST_CASE("S25: invalid models give an error or silence, never NaN", "[stress_linear]") {
  const auto complaints = [](const std::string& text) {
    std::string all;
    for (const Diagnostic& diagnostic : parse_network(text).diagnostics) {
      all += to_string(diagnostic, "x") + "\n";
    }
    return all;
  };
  const auto has = [](const std::string& text, const std::string& part) {
    INFO(text);
    CHECK(text.find(part) != text.npos);
  };
  const std::string pair = "@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n";
  has(complaints("@m mass 0. 0. 0.\n"), "x:1:9: error: a mass must be above 0");
  has(complaints("@m mass -1. 0. 0.\n"), "x:1:9: error: a mass must be above 0");
  has(complaints(""), "x:1:1: error: the model is empty");
  has(complaints(pair + "@r spring @a @b 0.1\n@r spring @a @b 0.1\n"), "'@r' is already declared");
  has(complaints(pair + "@r spring @a @a 0.1\n"), "x:4:");
  has(complaints("@a mass 1. 0. 0.\n"), "output");
  has(complaints("@a mass 1. 0. [1/0]\n"), "error");

  // Accepted models give finite output under any input.
  const std::string heard = "@in1 frcInput @a\n" + scenes::output(1, "a");
  for (const std::string& text :
       {"@M param 0.\n@g ground 0.\n@a mass M 0. 0.\n@r spring @g @a 0.1\n" + heard,  // Mass 0.
        pair + "@r spring @g @a -0.1\n" + heard,                                      // Negative K.
        pair + "@r damper @g @a -0.1\n" + heard,                                      // Negative Z.
        pair + "@r spring @a @a 0.1\n" + heard,                               // A link to itself.
        pair + "@r spring @a @b 0.1\n@s spring @a @b 0.1\n" + heard,          // A duplicate link.
        "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@r spring @a @b 0.1\n" + heard,  // No ground.
        "@a mass 1. 0. 0.\n" + heard,                                         // No link.
        "@g ground 0.\n" + scenes::output(1, "g")}) {                         // No mass.
    INFO(text);
    auto compiled = compile_network(network_of(text), default_preset(network_of(text), false), {});
    if (!compiled) {
      has(compiled.error().message, "is not above 0");
      continue;
    }
    std::vector<double> out(256);
    double* const outputs[] = {out.data()};
    for (int n = 0; n < 400; ++n) {
      const std::vector<Event> events = {note_on(0, 60, 1.0),
                                         {.frame = 1,
                                          .kind = EventKind::gesture,
                                          .gesture = Gesture::force,
                                          .index = 1,
                                          .value = n % 3 == 0 ? 1e300 : 1.0}};
      compiled->engine->process(events, {}, outputs, out.size());
      REQUIRE(std::all_of(out.begin(), out.end(), [](double y) { return std::isfinite(y); }));
    }
  }
}

TEST_CASE("S25: a parameter is kept from values that make an argument NaN", "[stress_linear]") {
  // 1/p, and a mass that may vanish: the ranges end before these values.
  for (const std::string& text :
       {"@p param 0.5\n@o osc 1. 0.1/p 0. 0. 0.\n@in1 frcInput @o\n" + scenes::output(1, "o"),
        "@p param 0.5\n@o osc p 0.1 0. 0. 0.\n@in1 frcInput @o\n" + scenes::output(1, "o")}) {
    Preset preset = struck(1);
    preset.parameters.push_back({"p", 0.5, 0.0, 1.0, {}});
    Player player(text, preset, {});
    CHECK(player.compiled.instrument.parameters[0].minimum > 0.0);
    CHECK(player.compiled.instrument.parameters[0].is_raised);
    player.run(5000, {note_on(0, 60), parameter(100, 0, 0.0), parameter(2000, 0, -1.0)});
    CHECK(player.engine().parameter(0) == player.compiled.instrument.parameters[0].minimum);
    CHECK(player.engine().meters().resets == 0);
    CHECK(std::all_of(player.y().begin(), player.y().end(),
                      [](double y) { return std::isfinite(y); }));
  }
}

TEST_CASE("S25: events with NaN are ignored", "[stress_linear]") {
  Player player(ringing_string(), struck(2));
  std::vector<Event> events = {note_on(0, 60)};
  std::uint32_t frame = 1;
  for (int kind = 0; kind < static_cast<int>(EventKind::panic); ++kind) {
    for (const double value : {nan, infinity, -infinity}) {
      for (const bool second : {false, true}) {
        events.push_back({.frame = frame++,
                          .kind = static_cast<EventKind>(kind),
                          .index = 1,
                          .value = second ? 0.5 : value,
                          .value2 = second ? value : 0.0});
      }
    }
  }
  player.run(4000, events);
  Player alone(ringing_string(), struck(2));
  alone.run(4000, {note_on(0, 60)});
  Comparison error;
  for (std::size_t n = 0; n < alone.y().size(); ++n) {
    error.add(alone.y()[n], player.y()[n]);
  }
  CHECK(error.relative() < 1e-12);  // A divided block is summed in another order.
}

TEST_CASE("S25: NaN input samples are silent, and later samples are heard", "[stress_linear]") {
  const std::string text = ringing_string();
  Preset preset = struck(1);
  preset.controls = {{.source = ControlSource::audio, .number = 1, .target = "in1"}};
  const auto heard = [&](float garbage, bool is_bare) {
    auto compiled =
        compile_network(network_of(text), is_bare ? default_preset(network_of(text), true) : preset,
                        {.bare = is_bare});
    REQUIRE(compiled);
    Process process(44100.0, false);
    process.slot.offer(new PlayingEngine{std::move(compiled->engine), 1});
    std::vector<float> input(256);
    std::vector<float> out(256);
    std::vector<float> all;
    const float* const inputs[] = {input.data()};
    float* const outputs[] = {out.data()};
    for (int n = 0; n < 100; ++n) {
      std::fill(input.begin(), input.end(), n % 10 == 3 ? garbage : 0.0f);
      input[5] = n % 20 == 0 ? 1e-3f : input[5];
      process.block(std::span<const float* const>(inputs), std::span<float* const>(outputs), 256,
                    {}, 0);
      all.insert(all.end(), out.begin(), out.end());
    }
    CHECK(process.meters().resets == 0);
    return all;
  };
  for (const bool is_bare : {false, true}) {
    const std::vector<float> clean = heard(0.0f, is_bare);
    CHECK(*std::max_element(clean.begin(), clean.end()) > 1e-5f);
    for (const double garbage : {nan, infinity, -infinity}) {
      CHECK(heard(static_cast<float>(garbage), is_bare) == clean);
    }
  }
}

TEST_CASE("S25: a force input accepts any level, and its sound decays", "[stress_linear]") {
  const std::string pair = "@g ground 0.\n@a mass 1. 0. 0.\n@s spring @g @a 0.05 1e-3\n";
  const std::string heard = "@in1 frcInput @a\n" + scenes::output(1, "a");
  constexpr std::size_t second = 44100;
  std::vector<double> noise(3 * second);
  Random random(7);
  std::generate_n(noise.begin(), second, [&] { return random.uniform(-1.0, 1.0); });
  const std::string texts[] = {
      pair + "@c nlSpring3 @g @a 0.01 1e4 0.\n" + heard,
      pair + "@c nlSpring @g @a 0.01 10. 0.01\n" + heard,
      pair + "@c contact @g @a 500. 0.1 0.01\n" + heard,
      pair + "@c nlSpringDamper @g @a 0.01 10. 5. 0.01\n" + heard,
      pair + "@p nlPluck @g @a 30. 0.05\n@b nlBow @g @a 2. 0.01\n" + heard,
      "@g ground 0.\n@d mesh 5 5 1. 0.1 1e-3 1e-4 0. 0.\n@h spring @g [@d 0. 0.] 0.1 0.01\n"
      "@w contact @g [@d 0.5 0.5] 50. 0.1 0.01\n@in1 frcInput [@d 0.3 0.7]\n"
      "@out1 posOutput [@d 0.8 0.2]\n"};
  for (const std::string& text : texts) {
    for (const double loudness : {1e-6, 1.0, 1e3, 1e6, 1e12, 1e100, 1e300}) {
      INFO(text << "loudness " << loudness);
      std::vector<double> force(noise.size());
      std::ranges::transform(noise, force.begin(), [&](double x) { return loudness * x; });
      Player player(text, default_preset(network_of(text), true),
                    {.bare = true, .budget = Budget{}});
      const double* const input = force.data();
      player.run(force.size(), {}, {256}, std::span(&input, 1));
      const std::span<const double> y = player.y();
      REQUIRE(std::ranges::all_of(y, [](double sample) { return std::isfinite(sample); }));
      // Measured by speed, because contacts displace the mean position; the tolerance of a tenth
      // allows for periods of few samples.
      const double soon = support::largest_step(y.subspan(second, second / 2));
      CHECK(support::largest_step(y.subspan(5 * second / 2)) <= 1.1 * soon);
      if (loudness <= 1e6) {
        CHECK(player.engine().meters().resets == 0);
        CHECK(soon > 0.0);
      }
    }
  }
}

}  // namespace ressort::stress_linear_test
