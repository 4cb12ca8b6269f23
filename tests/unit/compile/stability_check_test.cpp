// The stability check: which models are refused and why, the ranges of parameters, and that nothing
// leaves these ranges.
#include "core/compile/stability_check.h"

#include "app/session/compile_scene.h"
#include "core/model/topology.h"
#include "tests/support/player.h"
#include "tests/support/poles.h"

namespace ressort::stability_check_test {
namespace {

using namespace support;

Preset with_range(const std::string& name, double value, double least, double most) {
  Preset preset = struck(1);
  preset.keyboard = false;
  preset.parameters.push_back({name, value, least, most, {7, 3}});
  return preset;
}

const std::string oscillator =
    "@K param 0.5\n@o osc 1. K 0. 0. 0.\n@in1 frcInput @o\n" + scenes::output(1, "o");

Scene scene_of(const std::string& text, const Preset& preset = {}) {
  Scene scene;
  scene.path = "here.toml";
  scene.model_path = "there.mdl";
  scene.network = network_of(text);
  scene.preset = preset;
  return scene;
}

// Returns the error or the warning for a model without a preset; empty if it is admitted.
std::string message_of(const std::string& text, const CompileOptions& options = {}) {
  std::vector<std::string> warnings;
  const auto admitted = compile_scene(scene_of(text), options, warnings);
  REQUIRE(warnings.size() <= 1);
  return !admitted ? admitted.error().message : warnings.empty() ? "" : warnings[0];
}

const std::string ground = "@g ground 0.\n@m mass 1. 0. 0.\n";

ParameterBox box_of(const Instrument& instrument) {
  ParameterBox box;
  for (const ParameterInfo& info : instrument.parameters) {
    box.lowest.push_back(info.minimum);
    box.highest.push_back(info.maximum);
  }
  return box;
}

}  // namespace

TEST_CASE("An unstable model is refused with the name and line of the culprit, or forced",
          "[stability_check]") {
  CHECK(message_of(ground + "@r spring @g @m 3.9\n") == "");
  const std::string stiff = ground + "@r spring @g @m 5\n";
  CHECK(message_of(stiff) ==
        "there.mdl:3:1: error: unstable: the stiffness 5 of 'r' must stay below 4; pass --force to "
        "play it anyway");
  CHECK(message_of(stiff, {.force = true}) ==
        "there.mdl:3:1: warning: unstable: the stiffness 5 of 'r' must stay below 4");
  CHECK(message_of(ground + "@r damper @g @m 2.5\n")
            .find("the damping 2.5 of 'r' must stay below 2") != std::string::npos);
  CHECK(message_of("@o osc 0.01 0.1 0. 0. 0.\n").find("there.mdl:1:1: error: unstable") == 0);
  // A macro is one element, however many masses it has.
  CHECK(message_of("@d string 50 1. 1.2 0. 0. 0.\n").find("'d' must stay below 1.00102") !=
        std::string::npos);
  // The linear part of a cubic spring always acts.
  CHECK(message_of(ground + "@r nlSpring3 @g @m 5 0.1 0.\n").find("'r' must stay below 4") !=
        std::string::npos);
  // The stiffer of two parallel springs is named.
  CHECK(
      message_of(ground + "@d damper @g @m 0.01\n@r spring @g @m 5\n").find("5 of 'r' must stay") !=
      std::string::npos);
  // At half the rate it is four times as stiff.
  CHECK(message_of(ground + "@r spring @g @m 1.5\n", {.rate_hz = 22050.0})
            .find("'r' must stay below 1, at 22050 Hz") != std::string::npos);
  CHECK(message_of(ground + "@r spring @g @m 1.5\n", {.rate_hz = 22050.0, .rescale = false}) == "");
}

TEST_CASE("An argument that is not finite is refused with its element, line and parameters",
          "[stability_check]") {
  const auto said = [](const std::string& text, const std::vector<Setting>& settings = {}) {
    return message_of(text, {.bare = true, .force = true, .settings = settings});
  };
  CHECK(said("@P param 0\n" + ground + "@r spring @g @m 1/P\n") ==
        "there.mdl:4:1: error: the argument 1/P of 'r' is not finite when P = 0");
  CHECK(said("@P param 2\n" + ground + "@r spring @g @m 1/P\n") == "");
  CHECK(said("@P param 2\n" + ground + "@r spring @g @m 1/P\n", {{"P", 0.0}}) ==
        "there.mdl:4:1: error: the argument 1/P of 'r' is not finite when P = 0");
  CHECK(said("@P param 0\n@Q param 3\n  @o osc Q*P 0.1 0 0 0\n") ==
        "there.mdl:3:3: error: the mass Q*P of 'o' is not above 0 when P = 0 and Q = 3");
  CHECK(said("@P param 900\n@o osc 1 0.1 exp(P) 0 0\n") ==
        "there.mdl:2:1: error: the damping exp(P) of 'o' is not finite when P = 900");
  CHECK(said("@P param 0\n@s string 9 1 0.1 1/P 0 0\n") ==
        "there.mdl:2:1: error: the damping 1/P of 's' is not finite when P = 0");
  CHECK(said("@P param 0\n@s string 9 1 0.1 0 0 0\n@out1 posOutput [@s 1/P]\n") ==
        "there.mdl:3:17: error: the place 1/P is not finite when P = 0");
  // At a lower rate the stiffness grows. The values of an audio input are unknown.
  CHECK(message_of(ground + "@r spring @g @m 1e308\n", {.rate_hz = 8000.0, .force = true}) ==
        "there.mdl:3:1: error: the argument " + std::string("1e308") + " of 'r' is not finite");
  CHECK(compile_network(network_of("@K audioParam @in1\n@o osc 1 1/K 0 0 0\n"), {}, {}));
}

TEST_CASE("Numbers near the limits of double precision are reported correctly",
          "[stability_check]") {
  CHECK(message_of(ground + "@r spring @g @m 0.1 1e308\n")
            .find("the damping 1e308 of 'r' is too large for the analysis") != std::string::npos);
  for (const char* const stiffness : {"1e150", "1e262", "1e308"}) {
    INFO(stiffness);
    CHECK(message_of(ground + "@r spring @g @m " + stiffness + " 0.1\n")
              .find("of 'r' must stay below 3.8;") != std::string::npos);
  }
}

TEST_CASE("Contacts that may never close, and unproved models, are not refused",
          "[stability_check]") {
  for (const char* const link :
       {"contact @g @m 50 0.1 0.", "nlContact @g @m 0.1 0.1 50 0.1 0.", "nlPluck @g @m 500 0.1 0.",
        "nlBow @g @m 50 0.1", "nlBow @g @m 50 0.1 1", "nlSpringDamper @g @m 0.1 0.1 50 0.1"}) {
    INFO(link);
    CHECK(message_of(ground + "@s spring @g @m 0.1 0.1\n@l " + link + "\n").find("stable") ==
          std::string::npos);
  }
  CHECK(message_of(ground + "@r spring @g @m -0.1\n") ==
        "there.mdl:3:1: warning: may be unstable: the stiffness -0.1 of 'r' is negative, so motion "
        "can grow without end");
  // Too large to factorise and above the edge bound; a smaller stiffness is proved.
  const std::string mesh = "@d mesh 201 200 1. ";
  CHECK(message_of(mesh + "0.51 0. 0. 0.\n", {.method = Method::direct}).find(" warning: ") !=
        std::string::npos);
  CHECK(message_of(mesh + "0.49 0. 0. 0.\n", {.method = Method::direct}) == "");
}

TEST_CASE("Passive links are not part of the proof", "[stability_check]") {
  // 4M - S - 2Z < 0 as published; a passive link is only a potential and a damper.
  const std::string strong =
      "@g ground 0.\n@m mass 0.1 0. 0.\n@x nlSpringDamper @m @g 0.001 1e5 1e4 ";
  const CompileOptions as_played{.bare = true, .budget = Budget{}};
  const CompileOptions published{.bare = true};
  CHECK(message_of(strong + "0.5\n") == "");
  CHECK(message_of(strong + "0.5\n", as_played) == "");
  CHECK(message_of(strong + "0.5\n", published)
            .find("the damping 0.5 of 'x' must stay below 0.1995") != std::string::npos);
  // A negative stiffness or damping cannot be made passive, except in the middle of a spring.
  const auto is_told = [&](const std::string& link, const std::string& what) {
    const std::string may = "warning: may be unstable: the " + what + " of 'x' is negative";
    CAPTURE(link);
    CHECK(message_of(ground + "@x " + link + "\n").find(may) != std::string::npos);
    CHECK(message_of(ground + "@x " + link + "\n", as_played).find(may) != std::string::npos);
  };
  is_told("contact @m @g -0.1 0.01 0.", "stiffness -0.1");
  is_told("contact @m @g 0.1 -0.01 0.", "damping -0.01");
  is_told("nlBow @m @g -0.1 0.1", "damping -0.1");
  is_told("nlSpringDamper @m @g 0.1 0.1 -0.2 0.01", "stiffness -0.2");
  is_told("nlSpringDamper @m @g -0.1 0. 0.2 0.01", "stiffness -0.1");
  CHECK(message_of(ground + "@x nlSpringDamper @m @g -0.1 0.1 0.2 0.01\n") == "");
  // `check` prints the limits of the network that the proof covers.
  const auto made = compile_network(network_of(strong + "0.5\n"), {}, {});
  REQUIRE(made);
  CHECK(Stability(made->stability.proved, 1.0).certify({{}, {}}).verdict == Verdict::stable);
}

TEST_CASE("Ranges keep the stiffness of passive links positive", "[stability_check]") {
  const std::string touched =
      "@K param -0.5\n@g ground 0.\n@m mass 1. 0. 0.\n@s spring @m @g 0.1\n"
      "@c contact @m @g K 0.01 0.\n@in1 frcInput @m\n";
  const auto made = [&](double value, double least, double most) {
    auto compiled = compile_network(network_of(touched), with_range("K", value, least, most), {});
    REQUIRE(compiled);
    return std::move(compiled->stability);
  };
  // The value in the preset counts, whatever the formula looks like.
  const StabilityCheck usual = made(50., .1, 100.);
  CHECK(usual.verdict == Verdict::stable);
  CHECK(usual.parameters[0].maximum == 100.);
  CHECK(usual.narrowed.empty());
  const StabilityCheck narrowed = made(.5, -1., 1.);
  CHECK(narrowed.verdict == Verdict::stable);
  CHECK(narrowed.parameters[0].minimum == 0.);
  REQUIRE(narrowed.narrowed.size() == 1);
  CHECK(narrowed.narrowed[0].message == "'K' is kept above 0; below it the model is not stable");
  const StabilityCheck pushing = made(-.5, -1., 1.);
  CHECK(pushing.verdict == Verdict::unproved);
  REQUIRE(pushing.complaint);
  CHECK(pushing.complaint->message.find("the stiffness K = -0.5 of 'c' is negative") !=
        std::string::npos);
}

TEST_CASE("Random nonlinear scenes get the same verdict everywhere and are refused if they grow",
          "[stability_check]") {
  const CompileOptions as_played{.bare = true, .budget = Budget{}};
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Random random(seed);
    const auto any = [&](double least, double most) {
      return " " + show(least * std::pow(most / least, random.uniform(0.0, 1.0)));
    };
    const std::size_t masses = 1 + random.below(5);
    std::string text = "@g ground 0.\n";
    for (std::size_t i = 0; i < masses; ++i) {
      const std::string name = "@m" + std::to_string(i);
      text += name + " mass" + any(.1, 5.) + " 0. 0.\n@s" + std::to_string(i) + " spring " + name +
              (i == 0 ? " @g" : " @m" + std::to_string(random.below(i))) + any(1e-3, 2.) +
              any(1e-5, .3) + "\n";
    }
    std::string linear = text;  // the links that act at any displacement
    for (std::size_t i = 0; i < 4; ++i) {
      const std::string name = "@l" + std::to_string(i);
      const std::string ends = " @g @m" + std::to_string(random.below(masses));
      const std::string k = any(1e-3, 3.);
      const std::string z = any(1e-4, .5);
      const std::string laws[] = {" nlSpring" + ends + k + any(1e-3, 1e5) + z,
                                  " nlSpring3" + ends + k + any(1e-3, 1e5) + z,
                                  " nlSpringDamper" + ends + any(1e-3, 30.) + any(1e-3, 1e5) +
                                      any(1e-3, 1e5) + any(1e-3, 9.),
                                  " contact" + ends + any(1e-3, 1e5) + any(1e-3, 9.) + " 0.01",
                                  " nlPluck" + ends + any(1e-3, 1e5) + any(1e-3, .3)};
      const std::size_t law = random.below(std::size(laws));
      text += name + laws[law] + "\n";
      linear += law < 2 ? name + " spring" + ends + k + z + "\n" : "";
    }
    INFO("seed " << seed << "\n" << text);
    const auto played = compile_network(network_of(text), {}, {});
    REQUIRE(played);
    const ParameterBox none;
    const Verdict verdict = Stability(played->stability.proved, 1.0).certify(none).verdict;
    CHECK(played->stability.verdict == verdict);
    CHECK((verdict == Verdict::stable) == (spectral_radius(transition(program_of(linear))) < 1.0));
    const std::string said = message_of(text);
    CHECK(said == message_of(text, as_played));
    CHECK(said.empty() == (verdict == Verdict::stable));
    refused += verdict == Verdict::stable ? 0 : 1;
  }
  CHECK(refused > 20);
  CHECK(refused < 180);
}

TEST_CASE("A bow that is too strong for its time steps is reported at its line, or refused",
          "[stability_check]") {
  const std::string bowed = "@in1 posInput 0.\n@m osc 2. 0.01 0. 0. 0.\n@b nlBow @in1 @m ";
  const std::string heard = " 0.01\n@out1 posOutput @m\n";
  CHECK(message_of(bowed + "5.9" + heard) == "");
  const std::string told = message_of(bowed + "20" + heard);
  CHECK(told ==
        "there.mdl:3:1: warning: the bow 'b' is too strong: its Z of 20 per time step exceeds the "
        "limit of 6, three times the mass that it moves. It slips too early, and a single mass "
        "squeaks far above its pitch; lower Z, or use --method oversampled or a rate of 147000 Hz");
  CHECK(message_of(bowed + "20" + heard, {.method = Method::oversampled}) == "");
  CHECK(message_of(bowed + "20" + heard, {.rate_hz = 148000.0}) == "");
  CHECK(message_of(bowed + "100" + heard).find("; lower Z, or use a rate of 735000 Hz") !=
        std::string::npos);
  std::vector<std::string> warnings;
  const auto strict = compile_scene(scene_of(bowed + "20" + heard), {}, warnings, true);
  REQUIRE(!strict);
  CHECK(strict.error().message.find("there.mdl:3:1: error: the bow 'b'") == 0);
  // Published bows have no such limit. A place halfway between two masses has twice their mass.
  CHECK(message_of(bowed + "20" + heard,
                   {.bare = true, .budget = Budget{.passive = Passivity::never}})
            .find("is too strong") == std::string::npos);
  const std::string string =
      "@s string 9 2. 0.5 0. 0. 0.\n@in1 posInput 0.\n@out1 posOutput [@s 0.5]\n";
  CHECK(message_of(string + "@b nlBow @in1 [@s 0.4375] 11.9 0.01\n") == "");
  CHECK(message_of(string + "@b nlBow @in1 [@s 0.4375] 12.1 0.01\n").find("limit of 12, ") !=
        std::string::npos);
  // Keys scale the strength of a bow with the root of the stiffness.
  const auto keyed =
      compile_network(network_of(string + "@b nlBow @in1 [@s 0.5] 1.5 0.01\n"), struck(1), {});
  REQUIRE(keyed);
  const auto& notes = keyed->plan.notes;
  // 16 times the stiffness makes the bow four times as strong.
  const double hz = 4.0 * keyed->instrument.mode->frequency_hz;
  const std::string from = "above ";
  const auto note = std::find_if(notes.begin(), notes.end(), [&](const std::string& text) {
    return text.find(from) == 0 &&
           text.ends_with(" Hz the bow 'b' slips a little early at its strongest");
  });
  REQUIRE(note != notes.end());
  CHECK(std::stod(note->substr(from.size())) == Approx(hz).epsilon(.002));
}

TEST_CASE("A range that is too wide is narrowed and reported at its line", "[stability_check]") {
  std::vector<std::string> warnings;
  const auto low =
      compile_scene(scene_of(oscillator, with_range("K", 0.5, 0.1, 5.0)), {}, warnings);
  REQUIRE(low);
  CHECK(warnings == std::vector<std::string>{"here.toml:7:3: warning: 'K' is kept below 3.99999; "
                                             "above it the model is not stable"});
  const ParameterInfo& info = low->instrument.parameters[0];
  CHECK(info.minimum == 0.1);
  CHECK(info.maximum == 3.99999);
  CHECK(info.is_lowered);
  CHECK_FALSE(info.is_raised);
  CHECK(info.safe.lowest == 0.0);
  CHECK(info.safe.highest == Approx(4.0).epsilon(1e-12));
  warnings.clear();
  const std::string heavy = "@M param 1\n@o osc M 0.1 0.001 0. 0.\n" + scenes::output(1, "o");
  CHECK(compile_scene(scene_of(heavy, {.parameters = {{"M", 1.0, 0.02, 1.0, {4, 1}}}}), {},
                      warnings));
  CHECK(warnings == std::vector<std::string>{"here.toml:4:1: warning: 'M' is kept above 0.0255001; "
                                             "below it the model is not stable"});
  // The option `force` keeps the requested range.
  warnings.clear();
  const auto forced = compile_scene(scene_of(oscillator, with_range("K", 0.5, 0.1, 5.0)),
                                    {.force = true}, warnings);
  REQUIRE(forced);
  CHECK(warnings.empty());
  CHECK(forced->instrument.parameters[0].maximum == 5.0);
}

TEST_CASE("Ranges are stable in every common corner, and no smaller than necessary",
          "[stability_check]") {
  // The limit of each parameter alone is 1.3 and 0.6; together they allow less than requested.
  Preset preset = struck(1);
  preset.parameters.push_back({"m_K", 0.1, 0.01, 1.2, {}});
  preset.parameters.push_back({"m_Z", 0.001, 0.0, 0.5, {}});
  const Player player(scenes::poly_triangle(), preset);
  const Instrument& instrument = player.compiled.instrument;
  CHECK(player.compiled.stability.narrowed.size() == 2);
  Stability stability(network_of(scenes::poly_triangle()), 1.0);
  ParameterBox box = box_of(instrument);
  CHECK(stability.prove(box) == Verdict::stable);
  CHECK(box.highest[0] > 0.3);
  CHECK(box.highest[1] > 0.1);
  for (const std::size_t i : {0u, 1u}) {
    ParameterBox wider = box;
    wider.highest[i] *= 1.0 + 1e-4;
    CHECK(stability.prove(wider) == Verdict::unstable);
    // The reported limit is where the network becomes unstable.
    CHECK(instrument.parameters[i].safe.highest == Approx(box.highest[i]).epsilon(1e-5));
  }
}

TEST_CASE("Ranges of random presets are stable, and narrowed only if necessary",
          "[stability_check]") {
  support::Random random(41);
  int narrowed = 0;
  for (int i = 0; i < 300; ++i) {
    const auto strength = [&] { return std::pow(10.0, random.uniform(-1.5, 0.0)); };
    const std::string text = "@a param " + show(strength()) + "\n@b param " + show(strength()) +
                             "\n@c param " + show(0.2 * strength()) +
                             "\n@M param 1\n@g ground 0.\n@m0 mass M 0. 0.\n@m1 mass 1. 0. 0.\n"
                             "@s0 spring @g @m0 a c\n@s1 spring @m0 @m1 b*0.5+a*0.2\n"
                             "@s2 spring @g @m1 b 0.01\n" +
                             scenes::output(1, "m1");
    const Network network = network_of(text);
    Preset preset;
    for (const Parameter& parameter : network.parameters) {
      if (random.below(3) > 0) {
        const double value = parameter.value;
        preset.parameters.push_back({parameter.name,
                                     value,
                                     value * random.uniform(0.0, 1.0),
                                     value * random.uniform(1.0, 9.0),
                                     {}});
      }
    }
    auto compiled = compile_network(network, preset, {.method = Method::direct});
    INFO(text);
    REQUIRE(compiled);
    const Instrument& instrument = compiled->instrument;
    if (instrument.verdict != Verdict::stable) {
      continue;
    }
    Stability stability(network, 1.0);
    REQUIRE(stability.prove(box_of(instrument)) == Verdict::stable);
    const ParameterBox asked = preset_box(instrument.parameters, preset);
    const bool is_safe = stability.prove(asked) == Verdict::stable;
    REQUIRE(is_safe == compiled->stability.narrowed.empty());
    narrowed += is_safe ? 0 : 1;
  }
  CHECK(narrowed > 30);
}

TEST_CASE("No controller, event or start value leaves a parameter's stable range",
          "[stability_check]") {
  Preset preset = with_range("K", 0.5, 0.1, 5.0);
  preset.controls.push_back({.source = ControlSource::controller,
                             .number = 20,
                             .target = "K",
                             .gesture = Gesture::parameter,
                             .low = 0.1,
                             .high = 5.0});
  const Event turn{.frame = 100, .kind = EventKind::controller, .index = 20, .value = 1.0};
  const auto play = [&](const CompileOptions& options, const Event& event) {
    Player player(oscillator, preset, options);
    player.run(20000, {note_on(0, 60), event});
    CHECK(player.heap_calls == 0);
    return std::array{player.engine().parameter(0),
                      static_cast<double>(player.engine().meters().beyond),
                      static_cast<double>(player.engine().meters().resets)};
  };
  CHECK(play({}, turn) == std::array{3.99999, 1.0, 0.0});
  CHECK(play({}, parameter(100, 0, 4.5)) == std::array{3.99999, 1.0, 0.0});
  CHECK(play({}, parameter(100, 0, 3.0)) == std::array{3.0, 0.0, 0.0});
  CHECK(play({.force = true}, turn)[0] == 5.0);
  CHECK(play({.force = true}, turn)[2] > 0.0);
}

TEST_CASE("A high key is lowered before a parameter makes it unstable", "[stability_check]") {
  // Either m_K may grow four times, or keys may use 11.6 times the stiffness, but not both.
  Player player(scenes::poly_triangle(), struck(1));
  const ParameterInfo& stiffness = player.compiled.instrument.parameters[0];
  CHECK(stiffness.maximum == 0.4);
  CHECK_FALSE(stiffness.is_lowered);
  const auto key_hz = [](int key) { return 440.0 * std::exp2((key - 69) / 12.0); };
  int key = 60;
  while (key_hz(key + 1) < player.compiled.instrument.highest_frequency_hz) {
    ++key;
  }
  CHECK(key_hz(key) > 2500.0);
  player.run(44100, {note_on(0, key),
                     parameter(5000, 0, 0.11),
                     parameter(10000, 0, 0.25),
                     parameter(15000, 0, 0.4),
                     parameter(16000, 1, 0.004),
                     note_on(20000, key + 1),
                     {.frame = 30000, .kind = EventKind::bend, .value = 1.0}});
  CHECK(player.engine().parameter(0) == 0.4);
  CHECK(player.engine().meters().resets == 0);
  CHECK(player.heap_calls == 0);
  CHECK(peak(player.y()) < 1.0);
}

TEST_CASE("A parameter driven by audio stays in its stable range, sample by sample",
          "[stability_check]") {
  const std::string text =
      "@K audioParam @in2\n@o osc 1. K 0.01 0. 0.\n@in1 frcInput @o\n" + scenes::output(1, "o");
  std::vector<double> stiffness(20000);
  for (std::size_t n = 0; n < stiffness.size(); ++n) {
    stiffness[n] = n < 5000 ? 0.1 : n < 10000 ? 6.0 : n < 15000 ? -1.0 : 0.1;
  }
  const double* const inputs[] = {nullptr, stiffness.data()};
  Preset preset = struck(1);
  preset.keyboard = false;
  for (const bool force : {false, true}) {
    Player player(text, preset, {.force = force});
    player.run(5000, {note_on(0, 60)}, {256}, inputs);
    CHECK(player.engine().meters().beyond == 0);
    const double calm = peak(player.y());
    const double* const later[] = {nullptr, stiffness.data() + 5000};
    player.run(15000, {}, {256}, later);
    CHECK((player.engine().meters().resets > 0) == force);
    CHECK((player.engine().meters().beyond > 0) == !force);
    CHECK((force || peak(player.y()) < 100.0 * calm));
  }
}

namespace {

// Returns a few masses on springs with parameters, one of which is an audio input.
std::string sounding_network(Random& random) {
  const auto number = [&](double least, double most) { return show(random.uniform(least, most)); };
  std::string text = "@pK param " + number(.01, .2) + "\n@pZ param " + number(1e-4, .01) +
                     "\n@pM param " + number(.8, 3.) + "\n@qa audioParam @in1\n@g ground 0.\n";
  const std::size_t masses = 2 + random.below(7);
  for (std::size_t i = 0; i < masses; ++i) {
    const std::string here = "@q" + std::to_string(i);
    const std::string there = i == 0 ? "@g" : "@q" + std::to_string(random.below(i));
    const std::string m = random.below(2) == 0 ? "pM" : number(.8, 4.);
    const std::string k = random.below(2) == 0 ? "[pK*0.5+0.01]" : number(.01, .1);
    text += here +
            (random.below(3) == 0 ? " osc " + m + " " + number(1e-3, .05) + " 0.004 0. 0."
                                  : " mass " + m + " 0. 0.") +
            "\n@l" + std::to_string(i) + " springDamper " + there + " " + here + " " +
            (i == 0 ? "[qa*" + number(.02, .2) + "+" + number(.01, .05) + "]" : k) + " pZ\n";
  }
  return text + "@out1 posOutput @q0\n";
}

}  // namespace

TEST_CASE("An audio input takes no range of other parameters and makes no stiffness negative",
          "[stability_check]") {
  int crowded = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Random random(seed);
    const std::string text = sounding_network(random);
    const Network network = network_of(text);
    auto made = compile_network(network, {}, {});
    REQUIRE(made);
    INFO("seed " << seed << "\n" << text);
    const std::vector<double> start = parameter_values(network);
    // The same with a constant parameter instead of the audio input.
    std::string silent = text;
    silent.replace(silent.find("audioParam @in1"), 15, "param 0.");
    auto alone = compile_network(network_of(silent), {}, {});
    REQUIRE(alone);
    // Parameters whose default ranges are unstable together are narrowed, with a tenth reserved for
    // audio.
    bool is_crowded = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const ParameterInfo& info = made->instrument.parameters[i];
      const ParameterInfo& wanted = alone->instrument.parameters[i];
      is_crowded |= wanted.is_raised || wanted.is_lowered;
      CAPTURE(info.name);
      CHECK(info.minimum - start[i] <= .9 * (wanted.minimum - start[i]) + 1e-12);
      CHECK(info.maximum - start[i] >= .9 * (wanted.maximum - start[i]) - 1e-12);
    }
    for (std::size_t i = 0; i < 3 && !is_crowded; ++i) {
      CHECK(made->instrument.parameters[i].minimum <= .25 * start[i]);
      CHECK(made->instrument.parameters[i].maximum >= 4.0 * start[i]);
    }
    crowded += is_crowded ? 1 : 0;
    // The range of the stiffness that the audio input drives.
    const ParameterInfo& sound = made->instrument.parameters[3];
    const Link& turned = network.links[0];
    for (const double value : {sound.minimum, sound.maximum}) {
      std::vector<double> values = start;
      values[3] = value;
      const double k = evaluate(network.arguments[turned.arguments[0]], values);
      CAPTURE(value);
      CHECK(k >= -1e-12);
      CHECK(std::isfinite(k));
      CHECK(Stability(network, 1.0).prove({values, values}) == Verdict::stable);
    }
    CHECK(sound.maximum > .1);
    CHECK(sound.minimum < 0.0);
  }
  CHECK(crowded < 20);
}

TEST_CASE("A bare network takes any value that is stable", "[stability_check]") {
  const Network network = network_of(oscillator);
  const auto bare = [&](const std::vector<Setting>& settings, const std::vector<Setting>& reach) {
    auto compiled = compile_network(network, default_preset(network, true),
                                    {.bare = true, .settings = settings, .reach = reach});
    REQUIRE(compiled);
    return *std::move(compiled);
  };
  constexpr double anything = std::numeric_limits<double>::max();
  CHECK(bare({}, {}).instrument.parameters[0].maximum == anything);
  CHECK(bare({}, {{"K", 3.9}}).instrument.parameters[0].maximum == anything);
  CHECK(bare({}, {{"K", 4.1}}).instrument.parameters[0].maximum == 3.99999);
  CHECK(bare({}, {{"K", 4.1}}).instrument.parameters[0].minimum == -anything);
  CHECK(bare({{"K", 3.9}}, {}).stability.verdict == Verdict::stable);
  CHECK(bare({{"K", 4.1}}, {}).stability.verdict == Verdict::unstable);
}

TEST_CASE("A limit is printed in six digits, rounded inwards", "[stability_check]") {
  CHECK(inside_limit(1.31568650461023, true) == 1.31568);
  CHECK(inside_limit(4.0, true) == 3.99999);
  CHECK(inside_limit(1.31568, true) == 1.31567);
  CHECK(inside_limit(0.0889851164104615, false) == 0.0889852);
  CHECK(inside_limit(-4.0, false) == -3.99999);
  CHECK(inside_limit(0.0, true) == 0.0);
  CHECK(std::isinf(inside_limit(std::numeric_limits<double>::infinity(), true)));
}

}  // namespace ressort::stability_check_test
