// Every form that a random network has, and so every kernel that the plan may choose for it,
// against the direct kernel in double.
#include <map>
#include <set>

#include "core/compile/chains_form.h"
#include "core/compile/chorus_form.h"
#include "core/compile/dense_form.h"
#include "core/compile/grid_form.h"
#include "core/compile/modal_form.h"
#include "core/compile/sparse_form.h"
#include "tests/agreement.h"
#include "tests/duel.h"
#include "tests/random_network.h"

namespace ressort {
namespace {

using rig::Comparison;
using rig::DuelOptions;
using rig::network_of;
using rig::Random;
using rig::RandomNetwork;
using rig::Score;

template <class Table>
void add_form(std::vector<std::pair<Method, Form>>& forms, Method method,
              std::optional<Table> table) {
  if (table) {
    forms.emplace_back(method, std::move(*table));
  }
}

std::vector<std::pair<Method, Form>> forms_of(const Program& program) {
  std::vector<std::pair<Method, Form>> forms;
  forms.emplace_back(Method::direct, Direct{});
  add_form(forms, Method::chains, chains_form(program));
  add_form(forms, Method::dense, dense_form(program));
  add_form(forms, Method::modal, modal_form(program));
  add_form(forms, Method::grid, grid_form(program));
  add_form(forms, Method::chorus, chorus_form(program));
  add_form(forms, Method::sparse, sparse_form(program));
  return forms;
}

// The whole network as one Program, and its parts where it has several.
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

// Rounding is half a thousand million times as coarse in float: what is followed there as well is
// not chaotic.
void check_not_chaotic(const std::vector<Comparison>& direct) {
  for (const Comparison& output : direct) {
    INFO("direct has " << output.snr_db() << " dB in float");
    CHECK(output.noise <= output.signal * 1e-7);
  }
}

void check_forms(Program program, const Score& score, bool is_plain, std::set<Method>& taken) {
  const std::vector<double> expected = rig::perform_directly(program, score);
  const auto against = [&](const std::vector<double>& found) {
    return rig::compare(program.outputs.size(), expected, found);
  };
  const double loudest = rig::compare(1, expected, expected)[0].peak;
  REQUIRE(loudest < 1e4);
  const auto forms = forms_of(program);
  for (const Isa isa : rig::isas()) {
    std::vector<Comparison> direct;
    for (const auto& [method, form] : forms) {
      INFO(method_name(method) << " on " << isa_name(isa));
      program.form = form;
      rig::check_double(method, against(rig::perform<double>(program, score, isa)));
      const auto in_float = against(rig::perform<float>(program, score, isa));
      if (method == Method::direct) {
        direct = in_float;
        check_not_chaotic(direct);
      }
      rig::check_float(method, in_float, direct, is_plain);
      if (loudest > 0.0) {
        taken.insert(method);
      }
    }
  }
}

}  // namespace

TEST_CASE("every form of a random network moves as it is written", "[forms]") {
  constexpr std::uint64_t networks = 208;
  std::map<Method, std::size_t> taken;
  for (std::uint64_t seed = 1; seed <= networks; ++seed) {
    const RandomNetwork network = rig::random_network(seed);
    INFO("seed " << seed << ", " << network.family << ":\n" << network.text);
    Random random(seed);
    DuelOptions options{
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
        check_forms(program, rig::score_of(program, options),
                    network.is_linear && !network.may_drift, here);
      }
    }
    for (const Method method : here) {
      ++taken[method];
    }
  }
  for (const Method method : all_methods) {
    INFO(method_name(method) << " took " << taken[method] << " of " << networks);
    CHECK(taken[method] >= 20);
  }
}

}  // namespace ressort
