// Striking a mass by name equals a force input on it, in every kernel, whether or not the model has
// such an input.
#include <set>

#include "tests/support/networks/random_network.h"
#include "tests/support/player.h"

namespace ressort::strike_test {
namespace {

using namespace support;

constexpr std::size_t frames = 4410;
constexpr std::uint32_t blow_frame = 1000;
constexpr double force = 0.01;

// The largest difference, relative to the largest expected value.
double difference(const std::vector<std::vector<double>>& expected,
                  const std::vector<std::vector<double>>& found) {
  double most = 0.0;
  double apart = 0.0;
  for (std::size_t channel = 0; channel < expected.size(); ++channel) {
    for (std::size_t n = 0; n < expected[channel].size(); ++n) {
      most = std::max(most, std::fabs(expected[channel][n]));
      apart = std::max(apart, std::fabs(expected[channel][n] - found[channel][n]));
    }
  }
  REQUIRE(most > 0.0);
  return apart / most;
}

using Sound = std::vector<std::vector<double>>;

// Masses that a name can reach, each with its Event::value2.
std::vector<std::pair<std::string, std::uint32_t>> named_masses(const std::string& text) {
  const Network network = network_of(text);
  std::vector<std::pair<std::string, std::uint32_t>> found;
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (moves(network.masses[i])) {
      found.emplace_back(network.masses[i].name.text(), i);
    }
  }
  return found;
}

Sound play(const std::string& text, const CompileOptions& options, const Event& blow,
           Plan* plan = nullptr) {
  Preset preset;
  preset.budget.passive = Passivity::never;
  Player player(text, preset, options);
  player.run(frames, {blow}, {256, 64, 1, 500, 37});
  CHECK(player.heap_calls == 0);
  if (plan != nullptr) {
    *plan = player.compiled.plan;
  }
  return player.out;
}

Event struck_at(std::uint32_t mass) {
  return {.frame = blow_frame,
          .kind = EventKind::strike,
          .value = force,
          .value2 = static_cast<double>(mass)};
}

Event pushed() {
  return {.frame = blow_frame,
          .kind = EventKind::gesture,
          .gesture = Gesture::force,
          .index = 20,
          .value = force};
}

// The same place in a model without and with an input there.
struct StruckTwice {
  std::string text;
  std::string with_input;
  Event blow;
  Event blow_with_input;
};

// Checks that with every published kernel a strike has the effect of the input in the direct
// kernel, whether or not the model has such an input.
void check_strike(const StruckTwice& struck, std::set<Method>& seen) {
  CompileOptions options{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
  const Sound by_input = play(struck.with_input, options, pushed());
  for (const Method method : published_methods()) {
    INFO(struck.text << "by " << method_name(method));
    Plan plan;
    options.method = method;
    CHECK(difference(by_input, play(struck.with_input, options, struck.blow_with_input, &plan)) <
          1e-9);
    CHECK(difference(by_input, play(struck.text, options, struck.blow)) < 1e-9);
    for (const Part& part : plan.parts) {
      seen.insert(part.method);
    }
  }
}

// Without damping, a strike between two samples equals a force in the second sample to rounding,
// because links act by earlier positions.
TEST_CASE("A struck mass moves as a force input would move it", "[strike]") {
  const std::vector<std::string> texts = {
      scenes::string("s", 20, "0.1", "0.") + "@in1 frcInput @s_m4\n" + scenes::output(1, "s_m16"),
      scenes::string("s", 12, "0.1", "0.") +
          "@in2 posInput 0.01\n@touch nlContact @s_m8 @in2 0.002 0.05 0. 0. 0.01\n"
          "@b nlSpring3 @s_m2 @s_m9 0.01 0.05 0.\n" +
          scenes::output(1, "s_m5"),
      scenes::square_mesh("m", 5, 6, "0.1", "0.") + "@in1 frcInput @m_m2_2\n" +
          scenes::output(1, "m_m3_4") + scenes::output(2, "m_m1_3"),
      scenes::triangle("0.1", "0.") + scenes::string("s", 30, "0.2", "0.") +
          "@j springDamper @m_m0 @s_m3 0.02 0.\n@a osc 2. 0.01 0. 0. 0.\n"
          "@h springDamper @a @s_m20 0.05 0.\n@in1 frcInput @m_m1\n" +
          scenes::output(1, "s_m12") + scenes::output(2, "m_m2") + scenes::output(3, "a")};
  std::set<Method> seen;
  for (const std::string& text : texts) {
    for (const auto& [name, mass] : named_masses(text)) {
      const std::string with_input = text + "\n@in20 frcInput @" + name + "\n";
      INFO(name);
      check_strike({text, with_input, struck_at(mass), struck_at(mass)}, seen);
    }
  }
  CHECK(seen.size() == published_methods().size());
}

// Kernels that compute forces within the sample damp the strike at once when there is damping, by a
// share of Z/M, at most 0.02 here.
TEST_CASE("A struck mass of any network moves nearly like one with a force input", "[strike]") {
  std::size_t compared = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const RandomNetwork random = random_network(seed);
    const auto masses = named_masses(random.text);
    // A force output includes the force of an input but not that of a strike.
    if (masses.empty() || !random.is_linear || random.text.find("frcOutput") != std::string::npos) {
      continue;
    }
    const auto& [name, mass] = masses[seed % masses.size()];
    const std::string text = random.text + "\n@in20 frcInput @" + name + "\n";
    for (const Method method : published_methods()) {
      INFO("seed " << seed << ", " << random.family << ", " << name << ", by "
                   << method_name(method));
      const CompileOptions options{.rate_hz = 48000.0, .bare = true, .method = method};
      const Sound quiet = play(text, options, struck_at(0xffffffu));
      Sound by_input = play(text, options, pushed());
      Sound by_blow = play(random.text, options, struck_at(mass));
      double most = 0.0;
      double apart = 0.0;
      for (std::size_t channel = 0; channel < quiet.size(); ++channel) {
        for (std::size_t n = 0; n < quiet[channel].size(); ++n) {
          most = std::max(most, std::fabs(by_input[channel][n] - quiet[channel][n]));
          apart = std::max(apart, std::fabs(by_input[channel][n] - by_blow[channel][n]));
        }
      }
      CHECK(apart <= 0.02 * most);
      compared += most > 0.0 ? 1 : 0;
    }
  }
  CHECK(compared > 100);
}

// A kernel inside another kernel is uninitialised before its first step. With several steps per
// sample the strike acts for part of a sample, which changes the fastest mode by a hundredth.
TEST_CASE("A voice is struck in its first sample", "[strike]") {
  const std::string text = scenes::string("s", 5, "0.000001", "0.") + scenes::output(1, "s_m3");
  Event blow = struck_at(named_masses(text)[1].second);
  blow.frame = 0;
  CompileOptions options{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
  const Sound direct = play(text, options, blow);
  for (const Method method : {Method::batch, Method::modal, Method::oversampled}) {
    INFO(method_name(method));
    options.method = method;
    Plan plan;
    CHECK(difference(direct, play(text, options, blow, &plan)) < 0.02);
    CHECK(plan.parts[0].method == method);
  }
}

// Returns the mass that a name refers to.
std::uint32_t mass_called(const std::string& text, const std::string& name) {
  const auto compiled =
      compile_network(network_of(text), Preset(), {.rate_hz = 48000.0, .bare = true});
  REQUIRE(compiled);
  const auto& struck = compiled->instrument.struck;
  const auto found = std::find_if(struck.begin(), struck.end(),
                                  [&](const StruckInfo& info) { return info.name == name; });
  REQUIRE(found != struck.end());
  REQUIRE(found->moves.empty());
  return found->first;
}

struct StruckPlace {
  std::string text;
  std::string place;  // Place as written in the model.
  std::string name;   // Name used for the strike.
};

// A strike with dampers equals a force input in kernels that store the forces of the next sample or
// know the loss of a mode: the direct and the modal kernel.
TEST_CASE("A struck place moves as a force input there would move it", "[strike]") {
  const std::string strings =
      "@p param 0.6\n@s waveguide 1. 220. 3. 0.4 0.\n@t openWaveguide 0.5 110. 3. 0.6 0.\n"
      "@bridge spring [@s 0.98] [@t 0.3] 0.2 0.01\n@w mass 8. 0.1 0.1\n"
      "@felt contact @w [@s 0.12] 0.5 0.01 0.\n@damper springDamper @w [@s p] 0. 0.02\n";
  const std::string bell =
      "@bell body 40. rim waist crown\n@b1 mode @bell 310.7 4.2 1. -0.61 0.02\n"
      "@b2 mode @bell 601.2 0.3 0.8 0.35 0.9\n@b3 mode @bell 1533. 0.05 -0.3 0.5 1.4\n"
      "@b4 mode @bell 23000. 0.05 0.2 0.3 0.4\n";  // It hardly rings.
  const std::string box =
      "@m mass 2. 0. 0.\n@c springDamper @m [@bell crown] 0.05 0.003\n" + scenes::output(3, "m");
  const std::string heard = "@out1 posOutput [@bell crown]\n@out2 posOutput [@bell 0.25]\n";
  const std::string still = "@k string 20 1. 0.1 0. 0. 0. 0.\n@out1 posOutput [@k 0.31]\n";
  const std::string skin = "@k mesh 5 6 1. 0.1 0. 0. 0. 0.\n@out1 posOutput [@k 0.31 0.7]\n";
  const std::vector<StruckPlace> places = {
      {strings + "@out1 posOutput [@s 0.3]\n@out2 posOutput [@t 1]\n", "[@s 0.3]", "s:0.3"},
      {strings + "@out1 posOutput [@s 0.3]\n@out2 posOutput [@t 1]\n", "[@s 0.12]", "s:0.12"},
      {strings + "@out1 posOutput [@s 0.3]\n", "[@t 0.3]", "t:0.3"},
      {strings + "@out1 posOutput [@t 1]\n", "[@t 1]", "t:1.0"},
      {strings + "@out1 posOutput [@t 1]\n", "[@s p]", "s:0.6"},
      {bell + heard, "[@bell crown]", "bell:crown"},
      {bell + heard, "[@bell 0.25]", "bell:0.25"},
      {bell + box + heard, "[@bell crown]", "bell:crown"},
      {still, "[@k 0.31]", "k:0.31"},
      {skin, "[@k 0.31 0.7]", "k:0.31:0.7"}};
  std::set<Method> seen;
  for (const auto& [text, place, name] : places) {
    const std::string with_input = text + "@in20 frcInput " + place + "\n";
    INFO(name);
    check_strike({text, with_input, struck_at(mass_called(text, name)),
                  struck_at(mass_called(with_input, name))},
                 seen);
  }
  CHECK(seen.contains(Method::direct));
  CHECK(seen.contains(Method::modal));
  CHECK(seen.size() >= 4);
}

// The same in a voice that notes play, also in single precision and at another pitch.
TEST_CASE("A struck place sounds at the pitch of the last key", "[strike]") {
  const std::string text =
      "@s waveguide 1. 220. 3. 0.4 0.\n@in1 frcInput [@s 0.2]\n@out1 posOutput [@s 0.3]\n";
  const auto by = [&](const Event& event, Precision precision) {
    Preset preset = support::struck(2);
    preset.gain = 1.0;
    Player player(text, preset, {.rate_hz = 48000.0, .precision = precision});
    player.run(20000, {note_on(0, 64, 1e-9), event});
    return player.out;
  };
  // The force is scaled so that the displacement is equal: a slower string needs less.
  const Event push{.frame = blow_frame,
                   .kind = EventKind::gesture,
                   .gesture = Gesture::force,
                   .index = 1,
                   .value = force * std::exp2((64.0 - 57.0) / 12.0)};
  for (const Precision precision : {Precision::float64, Precision::float32}) {
    const double apart =
        difference(by(push, precision), by(struck_at(mass_called(text, "s:0.2")), precision));
    CHECK(apart < (precision == Precision::float64 ? 1e-7 : 1e-5));
  }
}

TEST_CASE("A model without any input is struck, and costs nothing until then", "[strike]") {
  const std::string text = scenes::string("s", 20, "0.1", "0.001") + scenes::output(1, "s_m16");
  const std::string with_input = text + "@in20 frcInput @s_m4\n";
  const std::uint32_t mass = mass_called(text, "s_m4");
  const CompileOptions options{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
  CHECK(difference(play(with_input, options, pushed()), play(text, options, struck_at(mass))) <
        1e-9);
  Preset preset;
  Player player(text, preset, {.rate_hz = 48000.0});
  CHECK(player.compiled.engine->machine().parts.size() == 1);
  player.run(24000);
  CHECK(player.compiled.engine->meters().stepped == 0);
  CHECK(peak(player.y()) == 0.0);
  player.run(4410, {struck_at(mass)});
  CHECK(player.compiled.engine->meters().stepped == 1);
  CHECK(peak(player.y()) > 0.0);
  // Inaudible parts are removed, with or without strikes.
  const auto deaf =
      compile_network(network_of(scenes::string("s", 20, "0.1", "0.001")), preset, options);
  REQUIRE(deaf);
  CHECK(deaf->instrument.struck.empty());
  for (const Program& part : deaf->engine->machine().parts) {
    CHECK(part.moving == 0);
  }
}

}  // namespace
}  // namespace ressort::strike_test
