// An engine's energy readings, stable models that must not be reported as unstable, and takeovers
// of sleeping voices.
#include <memory>

#include "app/session/loader.h"
#include "core/engine/energy.h"
#include "tests/support/player.h"
#include "tests/support/thorough.h"

namespace ressort::watch_test {
namespace {

using support::Player;
using support::show;

// A mass on a spring, struck once at the start.
Player struck_mass(double stiffness, double damping, double rate_hz) {
  Preset preset = support::struck(1);
  preset.keyboard = false;
  Player player("@o osc 1. " + show(stiffness) + " " + show(damping) +
                    " 0. 0.\n@in1 frcInput @o\n@out1 posOutput @o\n",
                preset, {.rate_hz = rate_hz, .method = Method::direct});
  player.run(512,
             {{.kind = EventKind::gesture, .gesture = Gesture::force, .index = 1, .value = 0.1}});
  return player;
}

// --- meters -------------------------------------------------------------------------------------

TEST_CASE("The meter reads the energy of a blow at every rate", "[watch]") {
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    Player player = struck_mass(0.01, 0.0, rate_hz);
    player.run(4 * 8192);
    const EngineMeters now = player.engine().meters();
    INFO(rate_hz << " " << show(now.energy) << " " << show(now.loss));
    CHECK(now.is_whole);
    CHECK_FALSE(now.is_driven);
    // The energy is 1/2 p v, with half the velocity after the blow; the tolerance is one sample's
    // phase.
    CHECK(now.energy == Approx(0.5 * 0.1 * 0.1).epsilon(0.01));
    CHECK(std::fabs(now.loss) < 1e-9 * now.energy * rate_hz);
  }
}

TEST_CASE("The loss is the power of the dampers", "[watch]") {
  constexpr double damping = 2e-5;
  Player player = struck_mass(0.01, damping, 44100.0);
  player.run(2 * 8192);
  double before = 0.0;
  for (int look = 0; look < 5; ++look) {
    player.run(8192);
    const EngineMeters now = player.engine().meters();
    // Half of the energy is kinetic on average, so E falls as exp(-Z n).
    const double within = 44100.0 * (std::exp(damping * 4096.0) - 1.0) / 4096.0;
    INFO(show(now.energy) << ", " << show(now.loss / now.energy) << " of " << show(within));
    CHECK_FALSE(now.is_driven);
    CHECK(now.loss == Approx(within * now.energy).epsilon(0.01));
    CHECK((before == 0.0 || now.energy < before));
    before = now.energy;
  }
}

TEST_CASE("The loss is unknown while an input is driven", "[watch]") {
  Player player = struck_mass(0.01, 0.0, 44100.0);
  player.run(16384);
  CHECK_FALSE(player.engine().meters().is_driven);
  player.run(16384, {{.kind = EventKind::gesture,
                      .gesture = Gesture::force,
                      .index = 1,
                      .value = 1e-4,
                      .value2 = 10.0}});
  CHECK(player.engine().meters().is_driven);
  CHECK(player.engine().meters().loss == 0.0);
}

TEST_CASE("A large part's energy is added up in slices", "[watch]") {
  const Program program = support::program_of(scenes::square_mesh("m", 100, 100, "0.1", "0.001") +
                                              scenes::output(1, "m_m7_3"));
  const auto kernel = make_kernel<double>(program, 1, best_isa());
  for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
    kernel->coefficients.set(
        0, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0), false);
  }
  const LaneValues<double> values{kernel->coefficients.value.data(), kernel->width()};
  support::Random random(1);
  std::vector<double> x, v;
  for (std::size_t node = 0; node < program.position.size(); ++node) {
    x.push_back(random.uniform(-1.0, 1.0));
    v.push_back(random.uniform(-1.0, 1.0));
  }
  const double whole = energy_of(program, values, x.data(), v.data()).value;
  const std::size_t elements = x.size() + program.ends.size();
  for (const std::size_t slice : {1u, 777u, 10000u, 100000u}) {
    Energy sum;
    for (std::size_t first = 0; first < elements; first += slice) {
      add_energy(program, values, x.data(), v.data(), first, std::min(elements, first + slice),
                 sum);
    }
    CHECK(std::fabs(sum.value - whole) < 1e-12 * whole);
  }
  // An engine reads the energy while it plays blocks. Without dampers there is no loss.
  const std::string drum = scenes::square_mesh("m", 100, 100, "0.1", "0.") +
                           "@in1 frcInput @m_m20_30\n" + scenes::output(1, "m_m7_3");
  support::Bare<double> bare(support::program_of(drum));
  bare.step({0.1});
  REQUIRE(bare.kernel().save(0, x.data(), v.data()));
  const double given =
      energy_of(bare.program(),
                LaneValues<double>{bare.kernel().coefficients.value.data(), bare.kernel().width()},
                x.data(), v.data())
          .value;
  Preset preset = support::struck(1);
  preset.keyboard = false;
  Player player(drum, preset, {.method = Method::grid});
  player.run(12288,
             {{.kind = EventKind::gesture, .gesture = Gesture::force, .index = 1, .value = 0.1}});
  const EngineMeters now = player.engine().meters();
  INFO(show(now.energy) << " of " << show(given) << " " << show(now.loss));
  CHECK(now.is_whole);
  CHECK_FALSE(now.is_driven);
  CHECK(std::fabs(now.energy - given) < 1e-11 * given);
  CHECK(std::fabs(now.loss) < 1e-9 * given);
}

// --- sleep --------------------------------------------------------------------------------------

TEST_CASE("The end of sleep does not depend on the block size", "[watch]") {
  const bool has_noise = GENERATE(false, true);
  Preset preset = support::struck(1);
  preset.noise = has_noise;
  preset.controls.push_back(
      {.source = ControlSource::audio, .number = 1, .target = "in1", .low = 0.0, .high = 0.1});
  const std::string text =
      scenes::string("s", 10, "0.1", "0.01") + "@in1 frcInput @s_m2\n" + scenes::output(1, "s_m6");
  constexpr std::size_t frames = 200000;
  std::vector<double> audio(frames);
  audio[100037] = audio[150129] = 1.0;
  const std::vector<const double*> inputs = {audio.data()};
  const std::vector<Event> events = {support::note_on(3, 57), support::note_off(2000, 57)};
  Player whole(text, preset, {.method = Method::direct});  // exact to the last bit
  Player cut(text, preset, {.method = Method::direct});
  whole.run(90000, events, {4096}, inputs);
  CHECK(whole.engine().meters().saved == 1.0);
  cut.run(90000, events, {64, 100, 17, 1}, inputs);
  const std::vector<const double*> later = {audio.data() + 90000};
  const std::vector<Event> again = {support::note_on(30077, 60)};
  whole.run(110000, again, {4096}, later);
  cut.run(110000, again, {64, 100, 17, 1}, later);
  CHECK(support::peak({whole.y().data() + 100037, 1000}) > 1e-4);
  std::size_t off = 0;
  while (off < frames && whole.y()[off] == cut.y()[off]) {
    ++off;
  }
  INFO("until " << off << " "
                << (off < frames ? show(whole.y()[off]) + " " + show(cut.y()[off]) : ""));
  CHECK(std::equal(whole.y().begin(), whole.y().end(), cut.y().begin(), cut.y().end()));
}

// --- parts that are never frozen ----------------------------------------------------------------

// Runs the model as the program does, with its own gain, keys and the modulation wheel.
TEST_CASE("A part without a rest bound is always stepped", "[watch]") {
  struct Case {
    std::string name;
    std::string text;
  };
  const std::string live = "@K param 0.1\n";
  const std::vector<Case> cases = {
      {"a free pair", live + "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@s springDamper @a @b K 0.001\n"
                             "@in1 frcInput @a\n@out1 posOutput @b\n"},
      {"a free mesh", live + "@p mesh 5 5 1. K 0.001 0. 0.\n@in1 frcInput [@p 0.3 0.3]\n"
                             "@out1 posOutput [@p 0.7 0.2]\n"},
      {"a ball on a floor", live + "@g ground 0.\n@m massG 1. 0.00001 0.01 0.01\n"
                                   "@hit contact @g @m 0.3+K 0. 0.\n@in1 frcInput @m\n"
                                   "@out1 posOutput @m\n"},
      {"a force that is heard", live + "@g ground 0.\n@s string 20 1. K 0.001 0. 0.\n"
                                       "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.7]\n"
                                       "@out2 frcOutput [@s 0.1]\n"},
      {"a spring that may let go",
       "@K param 0.0\n@g ground 0.\n@a mass 1. 0. 0.\n"
       "@s springDamper @a @g K 0.001\n@in1 frcInput @a\n"
       "@out1 posOutput @a\n"},
  };
  for (const Case& one : cases) {
    const Network network = support::network_of(one.text);
    for (const Precision precision : {Precision::float32, Precision::float64}) {
      Player player(one.text, default_preset(network, false),
                    {.voices = 2, .precision = precision, .find_gain = true});
      INFO(one.name);
      player.run(30000, {support::note_on(0, 60), support::note_on(20000, 67)});
      for (const double value : {0.0, 0.05, 0.1, 0.2}) {
        player.run(20000, {support::parameter(3, 0, value), support::note_on(5000, 64)});
      }
      player.run(300000,
                 {support::note_off(0, 60), support::note_off(0, 67), support::note_off(0, 64)});
      for (const auto& channel : player.out) {
        CHECK(
            std::all_of(channel.begin(), channel.end(), [](double y) { return std::isfinite(y); }));
      }
      CHECK(support::peak(player.y()) > 0.0);
      CHECK(player.heap_calls == 0);
      const EngineMeters meters = player.engine().meters();
      CHECK(meters.resets == 0);
    }
  }
}

// --- stable instruments -------------------------------------------------------------------------

TEST_CASE("No shipped instrument is reported as unstable", "[watch]") {
  const std::string folder = std::string(RESSORT_SOURCE) + "/presets/";
  for (const std::string name :
       {"1000massString", "20x30mesh", "BowedString", "IPlayTheTriangle", "LargeTriangleMesh",
        "PhysicalLFO", "PluckedHarmonics", "PolyTriangle", "Resonator"}) {
    for (const Precision precision : {Precision::float32, Precision::float64}) {
      if (precision == Precision::float64 && !support::is_thorough()) {
        continue;  // the other precision has a smaller margin
      }
      const auto scene = load_scene(folder + name + ".toml", {});
      REQUIRE(scene);
      auto compiled = compile_network(scene->network, scene->preset, {.precision = precision});
      REQUIRE(compiled);
      Engine& engine = *compiled->engine;
      std::vector<std::vector<double>> sound(static_cast<std::size_t>(engine.output_count()),
                                             std::vector<double>(441));
      std::vector<double*> outputs;
      for (auto& channel : sound) {
        outputs.push_back(channel.data());
      }
      constexpr std::array<int, 8> keys = {57, 60, 64, 69, 57, 64, 72, 45};
      for (std::size_t block = 0; block < support::of_all<std::size_t>(250, 500); ++block) {
        std::vector<Event> events;
        if (const std::size_t key = block / 50; block % 50 == 0 && key < keys.size()) {
          events.push_back(support::note_on(0, keys[key], 0.5 + 0.05 * static_cast<double>(key)));
        } else if (block % 50 == 45 && key < keys.size()) {
          events.push_back(support::note_off(0, keys[key]));
        }
        if (block < 300) {
          events.push_back(support::controller(0, 1, 0.5 + 0.4 * std::sin(0.1 * double(block))));
        }
        engine.process(events, {}, outputs, 441);
      }
      INFO(name);
      CHECK(engine.meters().resets == 0);
    }
  }
}

// --- takeover -----------------------------------------------------------------------------------

TEST_CASE("A frozen part is taken over frozen and unfreezes the same way", "[watch]") {
  const auto string = [](const std::string& p, int output) {
    return scenes::string(p, 10, "0.1", "0.01") + "@in" + std::to_string(output) + " frcInput @" +
           p + "_m2\n" + scenes::output(output, p + "_m6");
  };
  const std::string text = string("s", 1) + string("t", 2);
  Preset preset = support::struck(1);
  preset.keyboard = false;
  const auto blow = [](std::uint32_t frame, int input) {
    return Event{.frame = frame,
                 .kind = EventKind::gesture,
                 .gesture = Gesture::force,
                 .index = static_cast<std::uint16_t>(input),
                 .value = 0.1};
  };
  constexpr std::size_t quiet = 131072;
  std::vector<Event> events = {blow(0, 2)};
  for (std::uint32_t frame = 0; frame < quiet; frame += 8192) {
    events.push_back(blow(frame, 1));
  }
  for (const Method to : {Method::direct, Method::chains}) {
    for (const bool was_asleep : {false, true}) {
      Player stays(text, preset, {.method = Method::direct});
      Player leaves(text, preset, {.method = Method::direct});
      Player comes(text, preset, {.method = to});
      comes.run(was_asleep ? 16384 : 100);  // frozen in both of its parts, or in neither
      CHECK(comes.engine().meters().saved == (was_asleep ? 1.0 : 0.0));
      for (Player* player : {&stays, &leaves}) {
        player->run(quiet, events);
        player->run(4384, {blow(0, 1)});
        CHECK(player->engine().meters().saved == 0.5);
        CHECK(player->out[1].back() != 0.0);  // it keeps its frozen position
        CHECK(player->out[1].back() == player->out[1][quiet + 100]);
      }
      REQUIRE(comes.engine().continue_from(leaves.engine()));
      CHECK(comes.engine().meters().saved == 0.5);
      const std::size_t begun = comes.y().size();
      const std::size_t begun_there = stays.y().size();
      for (Player* player : {&stays, &comes}) {
        player->run(3000, {blow(1000, 2)});
      }
      double worst = 0.0;
      for (std::size_t channel = 0; channel < 2; ++channel) {
        for (std::size_t n = 0; n < 3000; ++n) {
          worst = std::max(worst, std::fabs(stays.out[channel][begun_there + n] -
                                            comes.out[channel][begun + n]));
        }
      }
      const double loudest = support::peak({stays.out[1].data() + begun_there, 3000});
      INFO(method_name(to) << " " << show(worst) << " of " << show(loudest));
      CHECK(loudest > 0.01);
      CHECK(worst < 1e-13 * loudest);
    }
  }
}

}  // namespace
}  // namespace ressort::watch_test
