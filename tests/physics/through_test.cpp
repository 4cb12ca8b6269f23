// The sum of all voices passes through bodies that are computed once.
#include <unistd.h>

#include <complex>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "app/session/compile_scene.h"
#include "core/compile/bodies.h"
#include "core/model/preset/fit.h"
#include "tests/support/player.h"

namespace ressort::through_test {
namespace {

using support::network_of;
using support::note_off;
using support::note_on;
using support::Player;

// A string that pulls at a bridge: its output is the force on its end.
const std::string strings =
    "@s string 24 1. 0.1 0.0005 0. 0.\n@in1 frcInput [@s 0.2]\n@out1 frcOutput [@s 0.]\n";

// A box with four modes, a place at the bridge and two that are heard.
const std::string box =
    "@loss param 1.\n@box body 40. bridge left right\n"
    "@b1 mode @box 110. 0.3*loss 1. 0.6 -0.5\n@b2 mode @box 231. 0.25*loss -0.7 0.8 0.9\n"
    "@b3 mode @box 377. 0.2*loss 0.5 -0.4 1.\n@b4 mode @box 960. 0.1*loss 0.9 0.4 -0.3\n"
    "@in1 frcInput [@box bridge]\n@out1 posOutput [@box left]\n@out2 posOutput [@box right]\n";

// A plate of springs and masses with two inputs, one of which is a position.
const std::string plate =
    "@p closedMesh 5 4 1. 0.05 0.002 0. 0.\n@in1 frcInput [@p 0.3 0.4]\n@in2 posInput 0.\n"
    "@touch springDamper @in2 [@p 0.6 0.6] 0.01 0.001\n@out1 posOutput [@p 0.5 0.5]\n";

Preset through(Preset preset, const std::vector<std::string>& bodies) {
  for (const std::string& text : bodies) {
    preset.bodies.push_back(
        {"/models/Body" + std::to_string(preset.bodies.size() + 1) + ".mdl", network_of(text)});
  }
  return preset;
}

Compiled compiled(const std::string& text, const Preset& preset,
                  const CompileOptions& options = {}) {
  auto made = compile_network(with_preset_parameters(network_of(text), preset), preset, options);
  INFO((made ? "" : made.error().message));
  REQUIRE(made);
  return *std::move(made);
}

// Returns the outputs of a model as the network alone, with audio channel n on input n.
std::vector<std::vector<double>> alone(const std::string& text,
                                       const std::vector<std::vector<double>>& inputs,
                                       double rate_hz = Network::reference_rate_hz) {
  const Network network = network_of(text);
  Player player(text, default_preset(network, true), {.rate_hz = rate_hz, .bare = true});
  std::vector<const double*> channels;
  for (const auto& input : inputs) {
    channels.push_back(input.data());
  }
  player.run(inputs.front().size(), {}, {256}, channels);
  return player.out;
}

void check_equal(const std::vector<double>& found, const std::vector<double>& expected,
                 double tolerance) {
  REQUIRE(found.size() == expected.size());
  support::Comparison comparison;
  for (std::size_t n = 0; n < expected.size(); ++n) {
    comparison.add(expected[n], found[n]);
  }
  REQUIRE(comparison.peak > 1e-6);
  CHECK(comparison.relative() < tolerance);
}

std::uint16_t index_of(const Compiled& of, const std::string& name) {
  const auto& parameters = of.instrument.parameters;
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const ParameterInfo& info) { return info.name == name; });
  REQUIRE(found != parameters.end());
  return static_cast<std::uint16_t>(found - parameters.begin());
}

}  // namespace

TEST_CASE("64 voices in one body are the body driven by the sum of 64 voices", "[through]") {
  constexpr std::size_t frames = 20'000;
  constexpr int lowest_key = 28;
  const auto key_of = [](std::size_t voice) { return lowest_key + static_cast<int>(voice); };
  const auto events_of = [&](std::size_t voice) {
    const auto start = static_cast<std::uint32_t>(200 * voice + 37);
    std::vector<Event> events = {note_on(start, key_of(voice), 0.3 + 0.01 * double(voice))};
    if (voice % 3 == 1) {
      events.push_back(note_off(start + 5000, key_of(voice)));
    }
    return events;
  };
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    // A soundboard's 64 strings at one rate, every eighth of them at the others.
    const std::size_t apart = rate_hz == 48000.0 ? 1 : 8;
    Preset preset = support::struck(64);
    preset.damper_s = 0.2;
    std::vector<double> sum(frames);
    std::vector<Event> all;
    for (std::size_t voice = 0; voice < 64; voice += apart) {
      Player one(strings, preset, {.rate_hz = rate_hz});
      one.run(frames, events_of(voice));
      for (std::size_t n = 0; n < frames; ++n) {
        sum[n] += one.y()[n];
      }
      const auto more = events_of(voice);
      all.insert(all.end(), more.begin(), more.end());
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Event& a, const Event& b) { return a.frame < b.frame; });
    preset.gain = 3.0;
    const auto expected = alone(box, {sum}, rate_hz);
    for (const std::size_t block : {256u, 33u}) {
      Player whole(compiled(strings, through(preset, {box}), {.rate_hz = rate_hz}));
      whole.run(frames, all, {block});
      REQUIRE(whole.out.size() == 2);
      for (std::size_t channel = 0; channel < 2; ++channel) {
        std::vector<double> heard = expected[channel];
        for (double& sample : heard) {
          sample *= preset.gain;
        }
        check_equal(whole.out[channel], heard, 1e-9);
      }
      CHECK(whole.heap_calls == 0);
    }
  }
}

TEST_CASE("bodies follow each other without a delay", "[through]") {
  Player voice(strings, support::struck(1));
  voice.run(8000, {note_on(10, 60)});
  Player chain(compiled(strings, through(support::struck(1), {box, plate})));
  chain.run(8000, {note_on(10, 60)});
  REQUIRE(chain.out.size() == 1);
  check_equal(chain.y(), alone(plate, alone(box, {voice.y()}))[0], 1e-9);
}

TEST_CASE("high resonances of two bodies do not make a voice count as unstable", "[through]") {
  const auto resonance = [](const std::string& k) {
    return "@m osc 1. " + k + " 0.00001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  };
  Preset preset = through(support::struck(1), {resonance("0.002"), resonance("0.2")});
  preset.gain = 0.0001;
  Player player(compiled(strings, preset));
  player.run(20'000, {note_on(0, 60)});
  CHECK(player.engine().meters().resets == 0);
  CHECK(support::peak(player.y()) < 1.0);
}

TEST_CASE("a body in single precision is as exact as a voice", "[through]") {
  Player exact(compiled(strings, through(support::struck(2), {box})));
  Player rounded(
      compiled(strings, through(support::struck(2), {box}), {.precision = Precision::float32}));
  for (Player* const player : {&exact, &rounded}) {
    player->run(20'000, {note_on(0, 60), note_on(3000, 67)});
  }
  check_equal(rounded.y(), exact.y(), 1e-4);
}

TEST_CASE("parameters of a body are parameters of the preset", "[through]") {
  const std::string one_mode =
      "@loss param 1.\n@b body 1. p\n@b1 mode @b 500. loss 1.\n@in1 frcInput [@b p]\n"
      "@out1 posOutput [@b p]\n";
  Preset preset = through(support::struck(1), {one_mode});
  preset.damper_s = 0.02;
  preset.parameters.push_back({.name = "loss", .value = 1.0, .minimum = 0.1, .maximum = 2.0});
  Compiled made = compiled(strings, preset);
  const std::uint16_t loss = index_of(made, "loss");
  CHECK(made.instrument.parameters[loss].maximum == 2.0);
  Player player(std::move(made));
  player.run(13'230, {note_on(0, 60), note_off(2000, 60)});
  const auto peak_of_last = [&](std::size_t frames) {
    return support::peak(std::span(player.y()).last(frames));
  };
  const double before = peak_of_last(441);
  player.run(4410);
  const double tenth_s_db = 20.0 * std::log10(before / peak_of_last(441));
  CHECK(tenth_s_db == Approx(6.0).margin(0.1));  // T60 of 1 s
  player.run(2205, {support::parameter(0, loss, 0.2)});
  const double turned = peak_of_last(441);
  player.run(2205);
  CHECK(20.0 * std::log10(turned / peak_of_last(441)) == Approx(15.0).margin(0.2));  // 0.2 s
  player.run(64, {support::parameter(0, loss, 5.0)});
  CHECK(player.engine().parameter(loss) >= 2.0);
}

TEST_CASE("a parameter of voices and body with one name is one parameter", "[through]") {
  const std::string tuned =
      "@K param 0.05\n@m osc 1. K 0.01 0. 0.\n@in1 frcInput @m\n"
      "@out1 posOutput @m\n";
  const std::string voices =
      "@K param 0.02\n@m osc 1. K 0.001 0. 0.\n@in1 frcInput @m\n"
      "@out1 posOutput @m\n";
  Preset preset = through(support::struck(1), {tuned});
  preset.keyboard = false;
  Player player(compiled(voices, preset));
  CHECK(player.compiled.instrument.parameters.size() == 1);
  player.run(4000, {note_on(0, 60)});
  Player voice(voices, [] {
    Preset alone = support::struck(1);
    alone.keyboard = false;
    return alone;
  }());
  voice.run(4000, {note_on(0, 60)});
  // The body starts at the voices' value.
  std::string same = tuned;
  same.replace(same.find("0.05"), 4, "0.02");
  check_equal(player.y(), alone(same, {voice.y()})[0], 1e-9);
}

TEST_CASE("a panic silences the body with the voices in 5 ms", "[through]") {
  const Event panic{.kind = EventKind::panic};
  for (const Event& end : {panic, support::controller(0, 120, 0.0)}) {
    Player player(compiled(strings, through(support::struck(4), {box})));
    player.run(5000, {note_on(0, 60), note_on(100, 64)});
    const double step = support::largest_step(player.y());
    const std::size_t start = player.y().size();
    player.run(5000, {end});
    const auto tail = std::span(player.y()).subspan(start - 1);
    CHECK(support::largest_step(tail) <= step);
    CHECK(support::peak(tail.first(50)) > 1e-3 * support::peak(player.y()));
    CHECK(support::peak(tail.subspan(222)) == 0.0);
    CHECK(player.engine().meters().voices == 0);
  }
}

TEST_CASE("a ringing body counts as sounding until it has rung out, and then sleeps", "[through]") {
  Preset preset = support::struck(2);
  preset.damper_s = 0.02;
  preset.gain = 100.0;
  Player player(compiled(strings, through(preset, {box})));
  player.run(4410, {note_on(0, 60), note_off(2000, 60)});
  CHECK(support::peak(std::span(player.y()).last(441)) > 1e-3);
  CHECK(player.engine().meters().voices == 1);
  player.run(3 * 44'100);
  CHECK(player.engine().meters().voices == 0);
  player.run(441);
  CHECK(support::peak(std::span(player.y()).last(441)) == 0.0);
  player.run(441, {note_on(0, 60)});
  CHECK(support::peak(std::span(player.y()).last(441)) > 1e-3);
}

TEST_CASE("a voice below -100 dB sounds on if the body makes it audible", "[through]") {
  const std::string loud =
      "@m osc 1. 0.05 0.1 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m 10000.\n";
  constexpr double softer = 1e-5;
  Preset preset = support::struck(1);
  Player voice(strings, preset);
  preset.controls[0].high *= softer;
  Player whole(compiled(strings, through(preset, {loud})));
  for (Player* const player : {&voice, &whole}) {
    player->run(60'000, {note_on(0, 60), note_off(100, 60)});
  }
  std::vector<double> soft = voice.y();
  for (double& sample : soft) {
    sample *= softer;
  }
  REQUIRE(support::peak(soft) < 1e-5);
  const auto expected = alone(loud, {soft})[0];
  REQUIRE(support::peak(std::span(expected).last(5000)) > 1e-4);
  check_equal(whole.y(), expected, 1e-9);
}

TEST_CASE("the gain of a body is that of its transfer function", "[through]") {
  constexpr double k = 0.02;
  constexpr double z = 0.004;
  const std::string text = "@m osc 1. 0.02 0.004 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  // One body, and the same after another one that is three times as loud.
  const std::string three = "@m osc 1. 0.02 0.004 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m 3.\n";
  for (const bool is_chain : {false, true}) {
    constexpr int points = 100'000;
    double most = 0.0;
    double squares = 0.0;
    for (int i = 1; i < points; ++i) {  // X (e^iw - (2 - K - Z) + (1 - Z) e^-iw) = F
      const std::complex<double> turn = std::polar(1.0, std::numbers::pi * i / points);
      const double one = 1.0 / std::abs(turn - (2.0 - k - z) + (1.0 - z) / turn);
      const double gain = 2.0 * (is_chain ? 3.0 * one * one : one);
      most = std::max(most, gain);
      squares += gain * gain;
    }
    Preset preset{.gain = 2.0, .keyboard = false};
    preset.controls.push_back({.source = ControlSource::audio, .number = 1, .target = "in1"});
    if (is_chain) {
      preset = through(preset, {text});
    }
    Compiled body = compiled(is_chain ? three : text, preset);
    const BodyGain gain = measure_gain(body, {});
    CHECK(gain.largest == Approx(most).epsilon(0.01));
    CHECK(gain.mean == Approx(std::sqrt(squares / points)).epsilon(0.01));
    // The body is at rest again.
    Player player(std::move(body));
    player.run(1000);
    CHECK(support::peak(player.y()) == 0.0);
  }
}

TEST_CASE("an engine with a body is continued in another form, and with another gain",
          "[through]") {
  const Preset preset = through(support::struck(2), {plate});
  const std::string two =
      "@s string 12 1. 0.1 0.002 0. 0.\n@in1 frcInput [@s 0.3]\n"
      "@out1 posOutput [@s 0.7]\n@out2 posOutput [@s 0.4]\n";
  const auto in_form = [&](Method method, double gain) {
    Preset own = preset;
    own.gain = gain;
    return compiled(two, own, {.method = method});
  };
  Player stays(in_form(Method::direct, 1.0));
  Player leaves(in_form(Method::direct, 1.0));
  Player other_form(in_form(Method::chains, 1.0));
  Player louder(in_form(Method::direct, 2.0));
  for (Player* const player : {&stays, &leaves}) {
    player->run(3000, {note_on(0, 60), note_on(500, 67)}, {64, 100, 17});
  }
  const support::HeapWatch watch;
  const bool continues = other_form.engine().continue_from(leaves.engine());
  const bool renumbers = louder.engine().renumber_from(leaves.engine());
  CHECK(watch.calls() == 0);
  REQUIRE(continues);
  REQUIRE(renumbers);
  for (Player* const player : {&stays, &other_form, &louder}) {
    player->run(6000, {note_on(2000, 64)}, {64, 100, 17});
  }
  const std::vector<double> rest(stays.y().end() - 6000, stays.y().end());
  check_equal(other_form.y(), rest, 1e-9);
  std::vector<double> doubled(rest.begin() + 1500, rest.end());  // after the ramp of 20 ms
  for (double& sample : doubled) {
    sample *= 2.0;
  }
  check_equal({louder.y().begin() + 1500, louder.y().end()}, doubled, 1e-9);
  Player bare(two, support::struck(2));
  CHECK_FALSE(bare.engine().continue_from(leaves.engine()));
}

TEST_CASE("an output without an input of the body is an error at the preset's line", "[through]") {
  Preset preset = through(support::struck(1), {box, box});
  preset.through_location = {2, 11};
  const Network network = with_preset_parameters(network_of(strings), preset);
  const auto errors = find_preset_errors(network, preset);
  REQUIRE(errors.size() == 1);
  CHECK(errors[0].message ==
        "'Body1.mdl' has an output 2, but 'Body2.mdl' in 'through' has no input 2; add @in2 "
        "there, or remove the output");
  CHECK(errors[0].line == 2);
}

TEST_CASE("'through' takes up to eight models", "[through]") {
  const auto message = [](const std::string& list) {
    const ParsedPreset parsed = parse_preset("model = \"a.mdl\"\nthrough = " + list + "\n");
    return parsed.ok()
               ? ""
               : to_string({.line = parsed.errors[0].line, .message = parsed.errors[0].message},
                           "p.toml");
  };
  std::string eight = "\"b.mdl\"";
  for (int i = 1; i < 8; ++i) {
    eight += ", \"b.mdl\"";
  }
  CHECK(message("[" + eight + "]").empty());
  for (const std::string& wrong : {"[" + eight + ", \"b.mdl\"]", std::string("[\"b.wav\"]"),
                                   std::string("\"b.mdl\""), std::string("[1]")}) {
    CHECK(message(wrong).starts_with("p.toml:2:"));
  }
}

TEST_CASE("errors in a body name its file and line", "[through]") {
  namespace fs = std::filesystem;
  const fs::path folder =
      fs::temp_directory_path() / ("ressort-through-" + std::to_string(getpid()));
  fs::create_directories(folder);
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / name) << text;
  };
  write("Strings.mdl", strings);
  write("p.toml",
        "model = \"Strings.mdl\"\nthrough = [\"Body.mdl\"]\n[parameters]\n"
        "K = { value = 0.1, range = [0.01, 0.2] }\n[[control]]\nfrom = \"note\"\n"
        "to = \"in1\"\nhow = \"impulse\"\n");
  const auto findings = [&](const std::string& text) {
    if (!text.empty()) {
      write("Body.mdl", text);
    }
    Reading reading = read_scene((folder / "p.toml").string(), {});
    std::vector<Finding> all = std::move(reading.findings);
    if (reading.scene) {
      CompiledScene scene = compile_to_play(*reading.scene, {});
      all.insert(all.end(), scene.findings.begin(), scene.findings.end());
    }
    std::string messages;
    for (const Finding& finding : all) {
      messages += to_string(finding) + "\n";
    }
    return messages;
  };
  const auto has = [](const std::string& text, const std::string& part) {
    INFO(text);
    return text.find(part) != text.npos;
  };
  const std::string good =
      "@K param 0.1\n@m osc 1. K 0.01 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  CHECK(has(findings(""), "p.toml:2:11: error: the model 'Body.mdl' is neither beside"));
  CHECK(findings(good).empty());
  CHECK(has(findings("@m osc 1. 0.1\n"), "Body.mdl:1:"));
  const std::string stiff =
      findings("@K param 0.1\n@m osc 1. K+5. 0.01 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n");
  CHECK(has(stiff, "Body.mdl:2:"));
  CHECK(has(stiff, "unstable"));
  const std::string divided = findings(
      "@K param 0.1\n@m osc 1. 0.1/(K-0.1) 0.01 0. 0.\n@in1 frcInput @m\n"
      "@out1 posOutput @m\n");
  CHECK(has(divided, "Body.mdl:2:"));
  CHECK(has(divided, "not finite"));
  fs::remove_all(folder);
}

}  // namespace ressort::through_test
