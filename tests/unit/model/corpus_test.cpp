// Small models that together use every construct of the language in every dialect. Tests how
// each is read, and that it follows its analytic solution.
#include <cctype>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "core/model/language/keywords.h"
#include "core/model/language/tokens.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::corpus_test {
namespace {

using support::show;

constexpr std::size_t frames = 3000;
constexpr auto delayed = ThirdArgument::delayed_position;
constexpr auto velocity = ThirdArgument::velocity_per_second;

const std::filesystem::path folder = RESSORT_SOURCE "/tests/corpus";

struct Model {
  const char* name;
  std::size_t masses;  // excluding points
  std::size_t links;
  std::size_t macros;
  std::size_t points;
  std::size_t parameters;
  std::size_t inputs;
  std::size_t outputs;
  ThirdArgument third;
  std::size_t warnings;
};

// clang-format off
constexpr Model models[] = {
    // name, masses, links, macros, points, parameters, inputs, outputs, third argument, warnings
    {"bodies",                                     1,  3, 2, 9, 2, 2, 3, velocity, 0},
    {"waveguides",                                 2,  3, 2, 6, 1, 2, 2, velocity, 0},
    {"common_at_rest_x_0",                         3,  2, 0, 0, 0, 0, 2, velocity, 0},
    {"common_at_rest_x_x",                         3,  2, 0, 0, 0, 0, 2, delayed,  0},
    {"common_parallel_and_self_links",             3,  5, 0, 0, 0, 1, 1, delayed,  1},
    {"common_thrown_0_x",                          2,  1, 0, 0, 0, 0, 1, delayed,  0},
    {"common_triangle_duplicate_link_labels",      4,  4, 0, 0, 2, 1, 2, delayed,  2},
    {"common_two_masses",                          3,  2, 0, 0, 0, 1, 1, delayed,  0},
    {"force_inputs_on_one_mass_and_gaps",          3,  2, 0, 0, 0, 5, 4, delayed,  6},
    {"force_outputs_at_places",                    0,  1, 2, 9, 0, 2, 5, velocity, 0},
    {"forward_references",                         3,  3, 1, 2, 4, 1, 2, velocity, 0},
    {"layout_cr_no_final_newline",                 2,  1, 0, 0, 0, 1, 1, delayed,  0},
    {"layout_crlf",                                2,  1, 0, 0, 0, 1, 1, delayed,  0},
    {"layout_prose_between_lines",                 2,  1, 0, 0, 0, 1, 1, delayed,  2},
    {"layout_tabs_indents_comments",               3,  2, 0, 0, 0, 1, 1, delayed,  0},
    {"macros_that_start_moving",                   0,  3, 5, 12, 0, 0, 6, velocity, 0},
    {"max_audio_parameters_in_arguments",          4,  4, 0, 0, 4, 1, 2, velocity, 0},
    {"max_contact_two_arguments",                  3,  2, 0, 0, 1, 0, 2, velocity, 0},
    {"max_display_blocks",                         5,  5, 1, 2, 0, 1, 2, velocity, 0},
    {"max_expressions_with_blanks",                4,  4, 0, 0, 2, 1, 1, velocity, 0},
    {"max_gravity_four_and_six_arguments",         3,  2, 0, 0, 1, 0, 2, velocity, 0},
    {"max_lost_slash",                             2,  1, 0, 0, 1, 1, 1, velocity, 1},
    {"max_meshes_and_places",                      0,  2, 3, 9, 1, 2, 3, velocity, 0},
    {"max_nlBow_both_profiles",                    4,  5, 0, 0, 1, 1, 3, velocity, 0},
    {"max_nlContact_both_counts",                  5,  6, 0, 0, 0, 2, 2, velocity, 0},
    {"max_nlPluck_damped",                         1,  1, 1, 2, 1, 1, 1, velocity, 0},
    {"max_nlSpringDamper_all_cases",               5,  4, 0, 0, 0, 1, 3, velocity, 0},
    {"max_place_by_audio_parameter",               1,  1, 1, 3, 1, 1, 3, velocity, 0},
    {"max_places_by_parameter_and_expression",     0,  1, 2, 9, 2, 2, 5, velocity, 0},
    {"max_strings_and_places",                     1,  4, 3, 11, 1, 2, 3, velocity, 0},
    {"max_vectors_and_velocities",                 4,  3, 0, 0, 0, 0, 3, velocity, 0},
    {"mims_cel",                                   3,  2, 0, 0, 0, 1, 2, delayed,  0},
    {"mims_contact_with_threshold",                5,  4, 0, 0, 0, 2, 3, delayed,  1},
    {"mims_display_triples",                       5,  4, 0, 0, 1, 1, 1, delayed,  0},
    {"mims_expressions_without_blanks",            3,  2, 0, 0, 3, 1, 1, delayed,  0},
    {"mims_massG",                                 3,  2, 0, 0, 0, 0, 2, delayed,  0},
    {"power_contact_all_counts",                   4,  5, 0, 0, 1, 1, 2, delayed,  0},
    {"mims_meshes_and_trailing_places",            0,  2, 3, 8, 1, 1, 3, delayed,  0},
    {"mims_nlBow_two_arguments",                   5,  4, 0, 0, 0, 1, 1, delayed,  0},
    {"mims_nlPluck_two_arguments",                 6,  5, 0, 0, 0, 1, 2, delayed,  0},
    {"mims_springDamperDamper",                    3,  2, 0, 0, 0, 1, 1, delayed,  0},
    {"mims_spring_k_z",                            6,  5, 0, 0, 2, 1, 1, delayed,  0},
    {"mims_strings_and_trailing_places",           2,  4, 3, 10, 0, 1, 4, delayed,  0},
    {"no_input",                                   3,  2, 0, 0, 0, 0, 2, delayed,  0},
    {"no_links",                                   2,  0, 0, 0, 0, 2, 2, delayed,  0},
    {"no_output",                                  2,  1, 0, 0, 0, 0, 0, delayed,  1},
    {"nonlinear_springs",                          4,  7, 0, 0, 1, 1, 3, delayed,  0},
    {"numbers_in_every_shape",                     5,  4, 0, 0, 0, 0, 2, delayed,  0},
    {"position_input_driven_and_read",             5,  4, 0, 0, 0, 2, 6, delayed,  0},
    {"unattached_and_unused",                      5,  1, 0, 0, 2, 2, 2, delayed,  4},
};
// clang-format on

std::string text_of(const std::string& name) {
  std::ifstream file(folder / (name + ".mdl"), std::ios::binary);
  REQUIRE(file);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// Returns input signals: [channel][frame]. Positions move slowly around their start, forces faster,
// and channels of parameters stay within 0..1.
std::vector<std::vector<double>> excitation(const Network& network) {
  int count = input_count(network);
  for (const Parameter& parameter : network.parameters) {
    count = std::max(count, parameter.audio_input);
  }
  std::vector<std::vector<double>> channels(static_cast<std::size_t>(count),
                                            std::vector<double>(frames));
  for (std::size_t c = 0; c < channels.size(); ++c) {
    double middle = 0.5;
    double reach = 0.45;
    double highest_hz = 300.0;
    for (const Input& input : network.inputs) {
      if (input.number == static_cast<int>(c) + 1) {
        middle = input.is_force ? 0.0 : network.masses[input.mass].position;
        reach = input.is_force ? 0.02 : 0.8;
        highest_hz = input.is_force ? 3000.0 : 100.0;
      }
    }
    const support::Motion motion(c + 7, 20.0, highest_hz);
    for (std::size_t n = 0; n < frames; ++n) {
      channels[c][n] = middle + reach * motion(n);
    }
  }
  return channels;
}

using ChannelSamples = std::vector<std::vector<double>>;  // [channel][frame]

// Returns one sample of the model's inputs.
std::vector<double> inputs_at(const Network& network, const ChannelSamples& channels,
                              std::size_t n) {
  std::vector<double> values;
  for (const Input& input : network.inputs) {
    values.push_back(channels[static_cast<std::size_t>(input.number - 1)][n]);
  }
  return values;
}

// Returns one sample of its parameters.
std::vector<double> parameters_at(const Network& network, const ChannelSamples& channels,
                                  std::size_t n) {
  std::vector<double> values = parameter_values(network);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int input = network.parameters[i].audio_input;
    values[i] = input == 0 ? values[i] : channels[static_cast<std::size_t>(input - 1)][n];
  }
  return values;
}

// Appends the channels of `step(n)` to `outputs`.
template <class Step>
ChannelSamples played(const Network& network, Step&& step) {
  ChannelSamples outputs(static_cast<std::size_t>(output_count(network)));
  for (std::size_t n = 0; n < frames; ++n) {
    const std::vector<double> values = step(n);
    for (std::size_t c = 0; c < outputs.size(); ++c) {
      outputs[c].push_back(values.at(c));
    }
  }
  return outputs;
}

ChannelSamples by_reference(const Network& network, const ChannelSamples& driven) {
  auto oracle = reference::make_simulation(network, parameters_at(network, driven, 0));
  return played(network, [&](std::size_t n) {
    oracle.set_parameters(network, parameters_at(network, driven, n));
    return oracle.simulator.step(inputs_at(network, driven, n));
  });
}

ChannelSamples by_kernel(const Network& network, const ChannelSamples& driven) {
  support::Bare<double> bare(make_program(network, 44100.0, true));
  return played(network, [&](std::size_t n) { return bare.step(inputs_at(network, driven, n)); });
}

ChannelSamples by_engine(const Network& network, const ChannelSamples& driven) {
  auto compiled = compile_network(network, default_preset(network, true), {.bare = true});
  REQUIRE(compiled);
  ChannelSamples outputs(static_cast<std::size_t>(output_count(network)),
                         std::vector<double>(frames));
  std::vector<double*> to;
  std::vector<const double*> from;
  for (auto& channel : outputs) {
    to.push_back(channel.data());
  }
  for (const auto& channel : driven) {
    from.push_back(channel.data());
  }
  compiled->engine->process({}, from, to, frames);
  return outputs;
}

bool is_heard(const Network& network, std::size_t channel) {
  return std::any_of(network.outputs.begin(), network.outputs.end(), [&](const Output& output) {
    return output.number == static_cast<int>(channel) + 1;
  });
}

void check_same(const Network& network, const ChannelSamples& expected,
                const ChannelSamples& found) {
  for (std::size_t c = 0; c < expected.size(); ++c) {
    support::Comparison comparison;
    for (std::size_t n = 0; n < frames; ++n) {
      comparison.add(expected[c][n], found[c][n]);
    }
    INFO("output " << c + 1 << ": peak " << show(comparison.peak) << ", residual "
                   << show(comparison.worst));
    CHECK((comparison.peak > 1e-6) == is_heard(network, c));
    CHECK(comparison.worst <= 1e-12 * comparison.peak);
  }
}

}  // namespace

TEST_CASE("every model of the corpus is read as described", "[corpus]") {
  for (const Model& model : models) {
    INFO(model.name);
    const ParsedNetwork parsed = parse_network(text_of(model.name));
    std::string told;
    for (const Diagnostic& diagnostic : parsed.diagnostics) {
      told += to_string(diagnostic, model.name) + "\n";
    }
    INFO(told);
    REQUIRE(parsed.ok());
    const Network& network = parsed.network;
    const auto points = static_cast<std::size_t>(
        std::count_if(network.masses.begin(), network.masses.end(),
                      [](const Mass& mass) { return mass.kind == MassKind::point; }));
    CHECK(network.masses.size() - points == model.masses);
    CHECK(network.links.size() == model.links);
    CHECK(network.macros.size() == model.macros);
    CHECK(points == model.points);
    CHECK(network.taps.size() == model.points);
    CHECK(network.parameters.size() == model.parameters);
    CHECK(network.inputs.size() == model.inputs);
    CHECK(network.outputs.size() == model.outputs);
    // Both meanings agree if every mass starts at 0, at rest.
    CHECK(network.third == (rests_at_zero(network) ? delayed : model.third));
    CHECK(parsed.diagnostics.size() == model.warnings);
  }
}

TEST_CASE("every model of the corpus follows its analytic solution", "[corpus]") {
  for (const Model& model : models) {
    INFO(model.name);
    const Network network = support::network_of(text_of(model.name));
    if (std::any_of(network.macros.begin(), network.macros.end(),
                    [](const Macro& macro) { return is_waveguide(macro.kind); })) {
      continue;  // no analytic solution
    }
    const ChannelSamples driven = excitation(network);
    const ChannelSamples expected = by_reference(network, driven);
    const bool is_steady =
        std::all_of(network.parameters.begin(), network.parameters.end(),
                    [](const Parameter& parameter) { return parameter.audio_input == 0; });
    if (is_steady) {
      INFO("the kernel alone");
      check_same(network, expected, by_kernel(network, driven));
    }
    INFO("the engine");
    check_same(network, expected, by_engine(network, driven));
  }
}

TEST_CASE("the corpus uses every keyword, and the table every file", "[corpus]") {
  std::set<std::string> names;
  std::set<std::string, std::less<>> words;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".mdl") {
      continue;
    }
    names.insert(entry.path().stem());
    std::string text = text_of(entry.path().stem());
    std::replace(text.begin(), text.end(), '\r', '\n');
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      const std::vector<Token> tokens = split(line);
      if (tokens.size() > 1 && tokens[0].text[0] == '@') {
        words.emplace(tokens[1].text);
      }
    }
  }
  std::set<std::string> told;
  for (const Model& model : models) {
    told.insert(model.name);
  }
  CHECK(names == told);
  for (const Keyword& keyword : keywords()) {
    INFO(keyword.word);
    // The reference of this test knows neither modal strings nor the engine's differences. They
    // have tests of their own.
    const bool has_own_test =
        keyword.word == "modalString" || keyword.word == "velOutput" || keyword.word == "accOutput";
    CHECK((words.contains(keyword.word) || has_own_test));
  }
}

}  // namespace ressort::corpus_test
