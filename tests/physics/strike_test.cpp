// A mass that is struck by its name: what a force input on it would do, in every kernel, whether or
// not the model has such an input.
#include <set>

#include "tests/support/player.h"
#include "tests/support/random_network.h"

namespace ressort {
namespace {

using namespace support;

constexpr std::size_t frames = 4410;
constexpr std::uint32_t blow_frame = 1000;
constexpr double force = 0.01;

// The greatest difference, of the greatest value that `expected` has.
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

// Masses that a name reaches, each with its Event::value2.
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

// Without damping a blow between two samples is what a force in the second of them does, to
// rounding: links pull by the places of before.
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
      CompileOptions options{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
      const Sound by_input = play(with_input, options, pushed());
      for (const Method method : methods_for(KernelRow::Use::published)) {
        INFO(text << name << ", by " << method_name(method));
        Plan plan;
        options.method = method;
        CHECK(difference(by_input, play(with_input, options, struck_at(mass), &plan)) < 1e-9);
        CHECK(difference(by_input, play(text, options, struck_at(mass))) < 1e-9);
        for (const Part& part : plan.parts) {
          seen.insert(part.method);
        }
      }
    }
  }
  CHECK(seen.size() == methods_for(KernelRow::Use::published).size());
}

// With it the blow is damped in its own sample already where a kernel finds forces as it goes: a
// share of Z/M, which is at most 0.02 here.
TEST_CASE("A struck mass of any network moves nearly so", "[strike]") {
  std::size_t compared = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const RandomNetwork random = NetworkWriter(seed).write();
    const auto masses = named_masses(random.text);
    // A force output is told of the input's force, and of no blow.
    if (masses.empty() || !random.is_linear || random.text.find("frcOutput") != std::string::npos) {
      continue;
    }
    const auto& [name, mass] = masses[seed % masses.size()];
    const std::string text = random.text + "\n@in20 frcInput @" + name + "\n";
    for (const Method method : methods_for(KernelRow::Use::published)) {
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

}  // namespace
}  // namespace ressort
