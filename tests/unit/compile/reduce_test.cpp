// Culling of masses that no output hears, and merging of parallel springs.
#include "core/compile/reduce.h"
#include "core/analysis/linear.h"
#include "core/compile/cull.h"
#include "core/model/topology.h"
#include "tests/support/comparison.h"
#include "tests/support/networks/random_network.h"
#include "tests/support/player.h"

namespace ressort::reduce_test {
namespace {

using support::network_of;
using support::Random;
using support::Score;
using support::show;

// Returns the score for a part of the network, which has some of the inputs.
Score score_for(const Program& part, const Program& whole, const Score& score) {
  Score some = score;
  for (std::size_t n = 0; n < score.inputs.size(); ++n) {
    some.inputs[n].clear();
    for (const InputSlot& slot : part.inputs) {
      for (std::size_t i = 0; i < whole.inputs.size(); ++i) {
        if (whole.inputs[i].input == slot.input) {
          some.inputs[n].push_back(score.inputs[n][i]);
        }
      }
    }
  }
  return some;
}

// [channel][frame] output of the whole network or of its remaining parts.
using Sound = std::vector<std::vector<double>>;

void add(Sound& sound, const Program& program, const Score& score) {
  const std::vector<double> heard = support::perform_directly(program, score);
  for (std::size_t i = 0; i < heard.size(); ++i) {
    const OutputSlot& output = program.outputs[i % program.outputs.size()];
    sound[output.channel][i / program.outputs.size()] += heard[i];
  }
}

// Returns masses that no output hears: on a ground, on a position input and behind a link without
// strength.
std::string unheard(Random& random) {
  std::string text;
  std::string before = random.below(2) == 0 ? "@g0" : "@in60";
  const std::size_t count = 1 + random.below(6);
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = "@deaf" + std::to_string(i);
    text +=
        name + " mass 1. 0. 0.3\n" + name + "s springDamper " + name + " " + before + " 0.1 0.01\n";
    before = name;
  }
  return text + "@in60 posInput 0.1\n@slack springDamper " + before + " @g0 0. 0.\n";
}

}  // namespace

TEST_CASE("Culling changes no bit of any output of 200 random networks", "[reduce]") {
  std::size_t left_out = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    INFO("seed " << seed);
    Random random(seed);
    const std::string text = support::random_network(seed).text + unheard(random);
    const Network network = network_of(text);
    const Program whole = make_program(network, Network::reference_rate_hz, true);
    const Score score = support::score_of(whole, {.frames = 400, .seed = seed, .turns = true});
    const Machine machine = make_machine(network, Network::reference_rate_hz, true);
    Sound all(machine.channels, std::vector<double>(400));
    Sound some = all;
    add(all, whole, score);
    std::size_t masses = 0;
    for (const Program& part : machine.parts) {
      masses += part.moving;
      if (!part.outputs.empty()) {
        add(some, part, score_for(part, whole, score));
      }
    }
    CHECK(some == all);
    CHECK(masses < whole.moving);
    left_out += whole.moving - masses;
  }
  CHECK(left_out > 400);
}

TEST_CASE("A mass that no output hears is left out", "[reduce]") {
  const auto said = [](const std::string& text) { return describe(cull(network_of(text))); };
  const std::string pair =
      "@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@s springDamper @a @b .1 0.\n"
      "@out1 posOutput @b\n";
  CHECK(said(pair) == "");  // a mass that no output hears may still be struck
  CHECK(said(pair + "@in1 frcInput @a\n") == "");
  CHECK(said(pair + "@in1 posInput 0.\n@t springDamper @in1 @a .1 0.\n") == "");
  // A ground passes no motion on...
  const std::string heard = pair + "@in1 frcInput @a\n@c mass 1. 0. .1\n";
  CHECK(said(heard + "@t springDamper @g @c .1 0.\n@u springDamper @g @a .1 0.\n") ==
        "1 mass that no output hears");
  // ...but an output can measure the force on a ground.
  CHECK(said(heard + "@t springDamper @g @c .1 0.\n@out2 frcOutput @g\n") == "");
  // A link without strength connects nothing; one whose strength is a parameter does.
  CHECK(said(heard + "@t springDamper @a @c 0. 0.\n") ==
        "1 mass that no output hears, 1 link without strength");
  CHECK(said(heard + "@z param 0.\n@t springDamper @a @c z 0.\n") == "");
  CHECK(said(heard + "@t nlPluck @a @c 0. .1 0.\n") ==
        "1 mass that no output hears, 1 link without strength");
}

TEST_CASE("Parallel springs are merged into one", "[reduce]") {
  const std::string one =
      "@g ground 0.\n@k param .03\n@m mass 1. .5 .5\n@out1 posOutput @m\n"
      "@a springDamper @m @g [.05+k] .003\n";
  const std::string three =
      "@g ground 0.\n@k param .03\n@m mass 1. .5 .5\n@out1 posOutput @m\n"
      "@a springDamper @m @g .05 .001\n@b springDamper @g @m [1*k] .001\n@c springDamper @m @g 0. "
      ".001\n";
  CHECK(merge_parallel_springs(network_of(three)).merged_springs == 2);
  const Reduced unchanged = merge_parallel_springs(network_of(one));
  CHECK(unchanged.merged_springs == 0);
  CHECK(unchanged.network == network_of(one));
  const auto play = [](const std::string& text) {
    support::Player player(text, {}, {.method = Method::direct});
    player.run(20'000);
    player.run(20'000, {support::parameter(0, 0, .06)});  // the parameter changes while it plays
    return player;
  };
  const support::Player first = play(one);
  const support::Player second = play(three);
  support::Comparison comparison;
  for (std::size_t n = 0; n < first.y().size(); ++n) {
    comparison.add(first.y()[n], second.y()[n]);
  }
  CHECK(comparison.peak > 0.1);
  CHECK(comparison.relative() < 1e-11);  // rounding, over 40 000 samples
  CHECK(second.compiled.plan.notes == std::vector<std::string>{"merged: 2 parallel springs"});
}

TEST_CASE("Parallel springs without dampers are merged", "[reduce]") {
  const Network network = network_of(
      "@s stiffString 5 1. .1 .02 .01 0. 0. 0.\n@t springDamper [@s .5] [@s .5] .1 0.\n@out1 "
      "posOutput [@s .5]\n");
  const Network expanded = expand_macros(network);
  Network twice = expanded;
  twice.links.insert(twice.links.end(), expanded.links.begin(), expanded.links.end());
  CHECK(merge_parallel_springs(twice).merged_springs >= expanded.links.size() - 1);
}

}  // namespace ressort::reduce_test
