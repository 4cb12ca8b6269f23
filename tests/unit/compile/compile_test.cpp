// Compiling a network and a preset into an engine.
#include "core/compile/compile.h"

#include "tests/support/player.h"

namespace ressort::compile_test {
namespace {

using namespace support;

Error error_of(const std::string& model, const std::string& toml) {
  const auto preset = parse_preset("model = \"x.mdl\"\n" + toml);
  REQUIRE(preset.ok());
  auto compiled = compile_network(network_of(model), preset.preset, {});
  REQUIRE_FALSE(compiled);
  return compiled.error();
}

}  // namespace

TEST_CASE("A preset that names a missing input or parameter is refused with its line",
          "[compile]") {
  const std::string model = scenes::iplay_the_triangle();
  Error error = error_of(model, "[parameters]\nm_k = { value = 1, range = [0, 1] }");
  CHECK(error.message == "the model has no parameter 'm_k'; it has m_K, m_Z");
  CHECK(error.line == 3);
  error = error_of(model, "[[control]]\nfrom = \"cc1\"\nto = \"m_Q\"");
  CHECK(error.message == "the model has no parameter 'm_Q'; it has m_K, m_Z");
  CHECK(error.line == 2);
  error = error_of(model, "[[control]]\nfrom = \"note\"\nto = \"in2\"");
  CHECK(error.message == "the model has no input 'in2'; it has 1");
  error = error_of(scenes::poly_triangle(),
                   "[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"bow\"");
  CHECK(error.message == "'in1' is a force input, but this gesture needs a position input");
  // The engine has one audio channel for each input.
  error = error_of(model, "[[control]]\nfrom = \"audio1\"\nto = \"m_K\"");
  CHECK(error.message == "an audio channel drives an input, not a parameter");
}

TEST_CASE("An instrument lists its parameters and inputs", "[compile]") {
  Preset preset = struck(7);
  preset.parameters.push_back({"m_K", 0.2, 0.1, 0.25});
  const Player player(scenes::poly_triangle(), preset);
  const Instrument& instrument = player.compiled.instrument;
  REQUIRE(instrument.parameters.size() == 2);
  CHECK(instrument.parameters[0].name == "m_K");
  CHECK(instrument.parameters[0].value == 0.2);
  CHECK(instrument.parameters[0].minimum == 0.1);
  CHECK(instrument.parameters[0].maximum == 0.25);
  CHECK(instrument.parameters[1].value == 0.001);  // as in the model
  REQUIRE(instrument.inputs.size() == 1);
  CHECK(instrument.inputs[0].is_force);
  CHECK(instrument.inputs[0].attached_to == "m_m1");
  CHECK(instrument.outputs == 1);
  CHECK(instrument.voices == 7);
  CHECK(instrument.masses == 3);
  CHECK(instrument.links == 4);
  CHECK(player.compiled.engine->parameter(0) == 0.2);
  // The margin is that of the worst corner of the ranges: m_K = .25, m_Z unchanged. The worst
  // motion is m0 against m1 and m2 together. With the factor s, (4 - .024 - .55 s)(4 - .002 - .25
  // s) = 2 (.002 + .25 s)^2.
  CHECK(instrument.stiffness_margin ==
        Approx((3.1949 - std::sqrt(3.1949 * 3.1949 - .05 * 15.89604)) / .025).epsilon(1e-12));
  REQUIRE(instrument.mode);
  CHECK(instrument.highest_frequency_hz > instrument.mode->frequency_hz);

  const Player bowed(scenes::bowed_string(),
                     default_preset(network_of(scenes::bowed_string()), false));
  CHECK(bowed.compiled.instrument.inputs[0].knows(Gesture::bow));
  CHECK_FALSE(bowed.compiled.instrument.inputs[0].knows(Gesture::pluck));
  CHECK(bowed.compiled.instrument.inputs[0].attached_to == "low_m133");
}

TEST_CASE("The plan lists the connected components and their forms", "[compile]") {
  const Machine machine = make_machine(
      network_of(scenes::string("a", 5, ".1", ".1") + scenes::string("b", 3, ".1", ".1") +
                 "@p nlPluck @a_m1 @a_m3 1 1\n@free mass 1. 0. 1.\n@out1 posOutput @a_m1\n"
                 "@out2 posOutput @b_m1\n@lone osc 1 .1 0 0 1\n@in1 frcInput @a_m2\n"
                 "@in2 frcInput @b_m2\n@out3 posOutput @free\n@out4 posOutput @lone\n"),
      44100.0, true);
  const Planned plan = make_plan(machine, {}, Method::direct);
  REQUIRE(plan.parts.size() == 3);  // the largest part first, all small parts as one
  CHECK(plan.parts[0].masses == 5);
  CHECK(plan.parts[0].links == 7);
  CHECK(plan.parts[1].masses == 3);
  CHECK(plan.parts[1].links == 4);
  CHECK(plan.parts[2].masses == 2);
  CHECK(plan.parts[2].links == 0);
  for (const Part& part : plan.parts) {
    CHECK(part.method == Method::direct);
    CHECK(part.estimated_ns > 0.0);
  }
  CHECK(describe(plan.parts).find("5 masses, 7 links") != std::string::npos);
  const Machine still = make_machine(network_of("@g ground 0."), 44100.0, true);
  CHECK(describe(make_plan(still, {}).parts) == "no mass moves\n");
}

TEST_CASE("The plan chooses the form with the lowest worst-case cost", "[compile]") {
  const auto chosen = [](const std::string& text, int voices = 1) {
    const Planned plan = make_plan(make_machine(network_of(text), 44100.0, true),
                                   {.isa = Isa::v3, .voices = voices});
    REQUIRE(plan.parts.size() == 1);
    CHECK(plan.parts[0].estimated_ns > 0.0);
    INFO(describe(plan.parts));
    // The chosen form is the one that runs.
    CHECK(row_of(plan.machine.parts[0].form).method == plan.parts[0].method);
    return plan.parts[0].method;
  };
  CHECK(chosen(scenes::poly_triangle()) == Method::batch);
  CHECK(chosen(scenes::iplay_the_triangle()) == Method::batch);
  CHECK(chosen(scenes::iplay_the_triangle(), 64) == Method::batch);
  const std::string picked = scenes::string("s", 6, "0.1", "0.01") +
                             "@in1 posInput 0.\n@pick nlPluck @in1 @s_m2 0.05 0.01\n" +
                             scenes::output(1, "s_m4");
  CHECK(chosen(picked) == Method::direct);
  CHECK(chosen(picked, 64) == Method::batch);
  CHECK(chosen(scenes::physical_lfo()) == Method::chains);
  CHECK(chosen(scenes::resonator()) == Method::chains);
  CHECK(chosen(scenes::bowed_string()) == Method::chains);
  CHECK(chosen(scenes::plucked_harmonics()) == Method::chains);
  CHECK(chosen(scenes::string_1000()) == Method::chains);
  CHECK(chosen(scenes::mesh_20x30()) == Method::modal);
}

TEST_CASE("A requested method is used if it can compute the part", "[compile]") {
  const Machine machine = make_machine(network_of(scenes::mesh_20x30()), 44100.0, true);
  for (const Method method : published_methods()) {
    const Planned plan = make_plan(machine, {}, method);
    REQUIRE(plan.parts.size() == 1);
    // The mesh is too large for batch and has no rows of equal masses for chains.
    const bool can = method != Method::batch && method != Method::chains;
    CHECK(plan.parts[0].method == (can ? method : Method::direct));
  }
}

TEST_CASE("The gain of a model without a preset makes a forte note peak at 0.5", "[compile]") {
  // Small models, played for a whole second.
  for (const std::string& text :
       {scenes::poly_triangle(), scenes::iplay_the_triangle(), ringing_string()}) {
    const Network network = network_of(text);
    Player player(text, default_preset(network, false), {.find_gain = true});
    // 4 million steps of a mass, at most a second, in blocks of 256.
    const double masses = static_cast<double>(player.compiled.instrument.masses);
    const double frames = std::ceil(std::min(4e6 / masses, 44100.0) / 256.0) * 256.0;
    player.run(static_cast<std::size_t>(frames), {note_on(0, 60, 0.8)});
    INFO("peak " << show(peak(player.y())));
    CHECK(peak(player.y()) == Approx(0.5).epsilon(1e-9));
  }
  // The gain is 1 if notes make no sound.
  const Preset silent = default_preset(network_of(scenes::resonator()), false);
  Player player(scenes::resonator(), silent, {.find_gain = true});
  player.run(44100, {note_on(0, 60, 0.8)});
  CHECK(peak(player.y()) == 0.0);
}

TEST_CASE("Rescaling keeps pitch and decay at another sample rate", "[compile]") {
  // One oscillator: r^n = (1 - z)^(n/2), theta by the closed form, at either rate.
  const std::string text = "@o osc 1. 0.001 0.0002 1. 0.\n@out1 posOutput @o\n";
  const Network network = network_of(text);
  const auto ring = [&](double rate_hz, bool rescale) {
    Bare<double> bare(make_program(network, rate_hz, rescale));
    const auto frames = static_cast<std::size_t>(rate_hz / 4);  // a quarter of a second
    std::vector<double> y;
    for (std::size_t n = 0; n < frames; ++n) {
      y.push_back(bare.step({})[0]);
    }
    const auto crossings = std::count_if(y.begin() + 1, y.end(), [&](const double& now) {
      return (now < 0.0) != ((&now)[-1] < 0.0);
    });
    return std::pair(static_cast<double>(crossings) / 0.5, peak(std::span(y).last(frames / 20)));
  };
  const auto [hz, left] = ring(44100.0, true);
  CHECK(hz == Approx(44100.0 * std::sqrt(0.001) / (2 * std::numbers::pi)).margin(2.1));
  CHECK(left == Approx(std::exp(-0.0001 * 0.2375 * 44100.0)).epsilon(0.02));
  for (const double rate_hz : {22050.0, 48000.0, 96000.0}) {
    const auto [other_hz, other_left] = ring(rate_hz, true);
    CHECK(std::fabs(other_hz - hz) <= 2.0);  // plus or minus half a period in a quarter second
    CHECK(other_left == Approx(left).epsilon(0.02));
  }
  CHECK(ring(88200.0, false).first == Approx(2.0 * hz).margin(4.1));
}

}  // namespace ressort::compile_test
