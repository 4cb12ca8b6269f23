// Compares every kernel that the plan may choose for a random network with the direct kernel in
// double.
#include <map>
#include <set>

#include "core/kernels/registry.h"
#include "tests/support/agreement.h"
#include "tests/support/comparison.h"
#include "tests/support/networks/random_network.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::forms_test {
namespace {

using support::Comparison;
using support::ComparisonOptions;
using support::network_of;
using support::Random;
using support::RandomNetwork;
using support::Score;
using support::show;

// Returns the forms of all kernels that can play the Program, that of the direct kernel first.
std::vector<std::pair<Method, Form>> forms_of(const Program& program) {
  std::vector<std::pair<Method, Form>> forms;
  for (const Method method : published_methods()) {
    if (const auto form = row_of(method).fits({program, Workload{}, Budget{}, Progress{}})) {
      forms.emplace_back(method, *form);
    }
  }
  return forms;
}

// The whole network as one Program, and its parts if it has several.
std::vector<Program> programs_of(const Network& network) {
  std::vector<Program> programs = {make_program(network, Network::reference_rate_hz, true)};
  Machine machine = make_machine(network, Network::reference_rate_hz, true);
  for (Program& part : machine.parts) {
    if (machine.parts.size() > 1 && part.moving > 0 && !part.outputs.empty()) {
      programs.push_back(std::move(part));
    }
  }
  return programs;
}

// Rounding in float is 5e8 times coarser. A network that float follows is not chaotic.
void check_not_chaotic(const std::vector<Comparison>& direct) {
  for (const Comparison& output : direct) {
    INFO("direct has " << output.snr_db() << " dB in float");
    CHECK(output.noise <= output.signal * 1e-7);
  }
}

void check_forms(Program program, const Score& score, const std::vector<Isa>& isas, bool is_plain,
                 std::set<Method>& taken) {
  const std::vector<double> expected = support::perform_directly(program, score);
  const auto against = [&](const std::vector<double>& found) {
    return support::compare(program.outputs.size(), expected, found);
  };
  const double loudest = support::compare(1, expected, expected)[0].peak;
  REQUIRE(loudest < 1e4);
  const auto forms = forms_of(program);
  for (const Isa isa : isas) {
    std::vector<Comparison> direct;
    for (const auto& [method, form] : forms) {
      INFO(method_name(method) << " on " << isa_name(isa));
      program.form = form;
      const auto in_double = against(support::perform<double>(program, score, isa));
      const auto in_float = against(support::perform<float>(program, score, isa));
      if (method == Method::direct) {
        direct = in_float;
        check_not_chaotic(direct);
      }
      support::check_double(method, in_double, in_float, direct);
      support::check_float(method, in_float, direct, is_plain);
      if (loudest > 0.0) {
        taken.insert(method);
      }
    }
  }
}

// A bow's force is discontinuous in its profile parameter, and must switch on the same sample in
// every kernel. Parameter changes take 128 samples, as in the other tests, and none crosses 0
// exactly on a sample.
Score turned_score(const Program& program) {
  Score score = support::score_of(
      program, {.frames = 12000, .reach = 0.02, .lowest_hz = 2.0, .highest_hz = 40.0});
  constexpr double profiles[] = {1.0, 0.0, 0.4, -0.7, 0.6};
  for (std::size_t block = 20, turn = 0; block < score.blocks.size(); block += 20, ++turn) {
    score.blocks[block].parameters = program.parameters;
    score.blocks[block].parameters[0] = profiles[turn % std::size(profiles)];
  }
  return score;
}

// The first output of the reference simulator; `is_turned`: the first parameter follows the score.
std::vector<double> by_the_book(const Network& network, const Score& score, bool is_turned) {
  std::vector<double> parameters = parameter_values(network);
  auto oracle = reference::make_simulation(network, parameters);
  std::vector<double> heard;
  double from = parameters[0];
  double to = from;
  std::size_t since = 128;
  for (const Score::Block& block : score.blocks) {
    if (is_turned && !block.parameters.empty()) {
      REQUIRE(since == 128);
      from = to;
      to = block.parameters[0];
      since = 0;
    }
    for (std::size_t n = 0; n < block.frames; ++n) {
      since = std::min<std::size_t>(since + 1, 128);
      parameters[0] = from + (to - from) * static_cast<double>(since) / 128.0;
      oracle.set_parameters(network, parameters);
      heard.push_back(oracle.simulator.step(score.inputs[heard.size()])[0]);
    }
  }
  return heard;
}

// Each kernel supports some of the networks.
void check_networks(const std::vector<Isa>& isas) {
  constexpr std::uint64_t networks = 208;
  std::map<Method, std::size_t> taken;
  for (std::uint64_t seed = 1; seed <= networks; ++seed) {
    const RandomNetwork network = support::random_network(seed);
    INFO("seed " << seed << ", " << network.family << ":\n" << network.text);
    Random random(seed);
    ComparisonOptions options{
        .frames = seed % 8 == 0 && !network.may_drift ? 44100 : 1500 + random.below(2000),
        .seed = seed,
        .reach = network.is_linear ? 0.1 : 0.02,
        .push = network.is_linear ? 0.01 : 0.001,
        .lowest_hz = 2.0,
        .highest_hz = 40.0,
        .pitch = random.uniform(0.5, 1.3)};
    std::set<Method> here;
    for (const Program& program : programs_of(network_of(network.text))) {
      for (const bool turns : {false, true}) {
        options.turns = turns;
        INFO((turns ? "turning" : "steady") << " at pitch " << options.pitch);
        check_forms(program, support::score_of(program, options), isas,
                    network.is_linear && !network.may_drift, here);
      }
    }
    for (const Method method : here) {
      ++taken[method];
    }
  }
  for (const Method method : published_methods()) {
    INFO(method_name(method) << " took " << taken[method] << " of " << networks);
    CHECK(taken[method] >= 20);
  }
}

}  // namespace

TEST_CASE("every kernel plays random networks like the direct form", "[forms]") {
  check_networks({best_isa()});
}

TEST_CASE("every kernel agrees on every instruction set", "[.][forms_everywhere]") {
  check_networks(support::isas());
}

TEST_CASE("a bow's profile changes while it plays, in every kernel that supports it", "[forms]") {
  std::set<Method> taken;
  for (const auto& [body, bowed, heard] :
       {std::tuple{scenes::string("s", 12, "0.1", "0.003"), "@s_m4", "s_m8"},
        std::tuple{scenes::square_mesh("m", 8, 7, "0.1", "0.003"), "@m_m2_3", "m_m5_4"}}) {
    const Network network = network_of("@p param 0\n" + body + "@in1 posInput 0.\n@b nlBow @in1 " +
                                       bowed + " 0.02 0.001 [2*p]\n" + scenes::output(1, heard));
    const Program program = make_program(network, Network::reference_rate_hz, true);
    const Score score = turned_score(program);
    check_forms(program, score, support::isas(), false, taken);
    const std::vector<double> direct = support::perform_directly(program, score);
    const Comparison turned = support::compare(1, by_the_book(network, score, true), direct)[0];
    const Comparison left = support::compare(1, by_the_book(network, score, false), direct)[0];
    INFO(bowed << ": " << show(turned.relative()) << ", not turned " << show(left.relative()));
    CHECK(turned.relative() < 1e-11);
    CHECK(left.relative() > 0.01);
  }
  CHECK(taken ==
        std::set{Method::direct, Method::chains, Method::modal, Method::grid, Method::batch});
}

}  // namespace ressort::forms_test
