// An engine takes over the state of another one of the same model in other forms, inaudibly.
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "app/session/session.h"
#include "tests/support/player.h"

namespace ressort::takeover_test {
namespace {

using support::Player;
using support::show;

// A string of masses on oscillators, with gravity, a contact and two inputs: all kinds of state.
const std::string body =
    scenes::string("s", 12, "0.1", "0.002") +
    "@o osc 1. 0.02 0.001 0.01 0.01\n@h springDamper @o @s_m3 s_K 0.001\n"
    "@w massG 1. 0.0001 0. 0.\n@d springDamper @w @s_m9 s_K 0.001\n"
    "@g ground -0.2\n@c contact @s_m5 @g 0.1 0.01 0.\n"
    "@in1 frcInput @s_m2\n@in2 posInput 0.\n@p springDamper @in2 @s_m8 0.05 0.001\n" +
    scenes::output(1, "s_m6");

Preset played() {
  Preset preset = support::struck(3);
  preset.controls.push_back({.source = ControlSource::controller,
                             .number = 1,
                             .target = "in2",
                             .gesture = Gesture::position,
                             .low = -0.3,
                             .high = 0.3});
  return preset;
}

CompileOptions in_form(Method method, Precision precision = Precision::float64) {
  return {.rate_hz = 48000.0, .precision = precision, .method = method};
}

const std::vector<Event> beginning = {support::note_on(0, 57), support::note_on(700, 64),
                                      support::controller(1000, 1, 0.9)};
const std::vector<Event> ending = {support::note_on(300, 69), support::note_off(500, 57),
                                   support::controller(900, 1, 0.1)};

// Returns the difference of the second half from an engine that was not replaced.
double difference(const std::string& text, const Preset& preset, int stiffness, Method from,
                  Method to, Precision precision = Precision::float64) {
  std::vector<Event> events = beginning;
  events.push_back(support::parameter(1950, stiffness, 0.102));
  Player stays(text, preset, in_form(from, precision));
  Player leaves(text, preset, in_form(from, precision));
  Player comes(text, preset, in_form(to, precision));
  for (Player* player : {&stays, &leaves}) {
    player->run(2000, events, {64, 100, 17});  // in the middle of the stiffness ramp
  }
  const support::HeapWatch watch;
  const bool continues = comes.engine().continue_from(leaves.engine());
  const std::size_t heap_calls = watch.calls();
  REQUIRE(continues);
  CHECK(heap_calls == 0);
  stays.run(4000, ending);
  comes.run(4000, ending);
  double worst = 0.0;
  for (std::size_t n = 0; n < 4000; ++n) {
    worst = std::max(worst, std::fabs(stays.y()[2000 + n] - comes.y()[n]));
  }
  return worst / support::peak({stays.y().data() + 2000, 4000});
}

// Skips kernels that cannot play the part, because the direct kernel would replace them.
bool has_form(const std::string& text, Method method) {
  const Machine machine = make_machine(support::network_of(text), 48000.0, true);
  return make_plan(machine, {}, method).parts[0].method == method;
}

TEST_CASE("An engine continues from the state of another", "[takeover]") {
  const std::string mesh = scenes::square_mesh("mesh", 10, 8, "0.1", "0.01") +
                           "@in1 frcInput @mesh_m2_6\n@in2 posInput 0.\n"
                           "@p springDamper @in2 @mesh_m5_5 mesh_K mesh_Z\n" +
                           scenes::output(1, "mesh_m7_3");
  std::set<Method> left;
  std::set<Method> reached;
  for (const auto& [text, stiffness] : {std::pair{body, 1}, std::pair{mesh, 0}}) {
    for (const Method from : published_methods()) {
      for (const Method to : published_methods()) {
        if (from == Method::modal || !has_form(text, from) || !has_form(text, to)) {
          continue;
        }
        left.insert(from);
        reached.insert(to);
        const double off = difference(text, played(), stiffness, from, to);
        const double off_in_float =
            difference(text, played(), stiffness, from, to, Precision::float32);
        INFO(method_name(from) << " to " << method_name(to) << ": " << show(off) << ", "
                               << show(off_in_float));
        CHECK(off < 1e-13);
        CHECK(off_in_float < 3e-6);
      }
    }
  }
  CHECK(left.size() == published_methods().size() - 1);
  CHECK(reached.size() == published_methods().size());
}

TEST_CASE("A modal form cannot reconstruct all masses", "[takeover]") {
  Player modal(support::ringing_string(), support::struck(1), in_form(Method::modal));
  Player direct(support::ringing_string(), support::struck(1), in_form(Method::direct));
  modal.run(500, {support::note_on(0, 57)});
  CHECK_FALSE(direct.engine().continue_from(modal.engine()));
  direct.run(500);
  CHECK(support::peak(direct.y()) == 0.0);
}

TEST_CASE("A damper that takes all velocity in one sample prevents a takeover", "[takeover]") {
  const std::string text = "@c osc 1. 0.5 " + std::to_string(48000.0 / 44100.0) +
                           " 0. 0.\n@m osc 2. 0.05 0.01 0. 0.\n@l springDamper @c @m 0.02 0.\n"
                           "@in1 frcInput @m\n@out1 posOutput @c\n";
  Player direct(text, support::struck(1), in_form(Method::direct));
  Player modal(text, support::struck(1), in_form(Method::modal));
  direct.run(500, {support::note_on(0, 57)});
  CHECK_FALSE(modal.engine().continue_from(direct.engine()));
  modal.run(500, {support::note_on(0, 57)});
  CHECK(std::isfinite(support::peak(modal.y())));
  CHECK(support::peak(modal.y()) > 0.0);
}

// Plays one callback of 64 frames, in which a key may be struck.
std::vector<double> listen(Process& process, bool strikes) {
  std::vector<double> left(64);
  std::vector<double*> outputs{left.data()};
  const std::uint8_t on[] = {0x90, 48, 100};
  const MidiPacket packet{7, on};
  process.block(std::span<const double* const>(), std::span<double* const>(outputs), 64,
                std::span(&packet, strikes ? 1 : 0), 0);
  return left;
}

TEST_CASE("A large mesh sounds at once, and by modes as soon as they are found", "[takeover]") {
  const std::string name = "ressort-takeover-" + std::to_string(getpid());
  const std::string path = (std::filesystem::temp_directory_path() / name).string();
  // Keys as low as these need no exact modes, so both forms are the published scheme.
  const std::string text = "model = \"" + name +
                           ".mdl\"\ngain = 8.8\nvoices = 2\n[[control]]\nfrom = \"note\"\n"
                           "to = \"in1\"\nhow = \"impulse\"\nkeys = [0, 50]\n";
  std::ofstream(path + ".mdl") << scenes::mesh_20x30();
  std::ofstream(path + ".toml") << text;
  Process relieved(48000.0);
  Session session(relieved, {.compile = {.rate_hz = 48000.0}}, {});
  const auto quick = session.load_and_wait(path + ".toml");
  REQUIRE(quick);
  std::filesystem::remove(path + ".mdl");
  std::filesystem::remove(path + ".toml");
  REQUIRE((*quick)->plan.parts[0].method != Method::modal);
  const Preset preset = parse_preset(text).preset;
  auto compiled = compile_network(support::network_of(scenes::mesh_20x30()), preset,
                                  {.rate_hz = 48000.0, .most_modes = quick_modes});
  REQUIRE(compiled);
  Process stays(48000.0);
  stays.slot.offer(new PlayingEngine{std::move(compiled->engine), 1});

  support::Comparison comparison;
  const auto play = [&](std::size_t blocks) {
    for (std::size_t n = 0; n < blocks; ++n) {
      const auto expected = listen(stays, n == 0);
      const auto found = listen(relieved, n == 0);
      for (std::size_t i = 0; i < expected.size(); ++i) {
        comparison.add(expected[i], found[i]);
      }
    }
  };
  play(50);  // it already sounds
  for (int patience = 0; patience < 5000 && relieved.meters().swaps < 2; ++patience) {
    play(20);
  }
  play(500);
  CHECK(session.current()->plan.parts[0].method == Method::modal);
  CHECK(relieved.meters().swaps == 2);
  CHECK(comparison.peak > 0.01);
  INFO(show(comparison.relative()));
  CHECK(comparison.relative() < 1e-11);
}

}  // namespace
}  // namespace ressort::takeover_test
