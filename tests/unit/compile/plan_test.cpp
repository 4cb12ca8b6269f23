// The choice among a part's forms by measured times. The test supplies the clock.
#include <map>

#include "core/compile/plan.h"
#include "core/model/generate.h"
#include "tests/support/player.h"

namespace ressort::plan_test {
namespace {

using namespace support;

// The estimates prefer chains; the direct form, batch or modes may be cheaper.
const std::string picked = scenes::string("s", 12, "0.1", "0.01") +
                           "@in1 posInput 0.\n@pick nlPluck @in1 @s_m2 0.05 0.01\n" +
                           scenes::output(1, "s_m4");

Machine machine_of(const std::string& text) {
  return make_machine(network_of(text), 44100.0, true);
}

// Returns `ns` per sample for the named forms and 1000 for all others, and counts its calls.
struct FakeClock {
  std::map<std::string, double> ns;
  std::size_t calls = 0;
  std::map<std::string, double> kept;

  Timings timings() {
    return {.time =
                [this](const Program& program, const std::function<void()>& play) {
                  play();
                  ++calls;
                  const auto found = ns.find(form_name(program.form));
                  return (found != ns.end() ? found->second : 1000.0) * max_block_frames;
                },
            .recall = [this](const std::string& key) -> std::optional<double> {
              const auto found = kept.find(key);
              return found != kept.end() ? std::optional(found->second) : std::nullopt;
            },
            .keep = [this](const std::string& key, double time) { kept[key] = time; }};
  }
};

Planned planned(const Machine& machine, const Choice& choice, int voices = 1) {
  Planned plan = make_plan(machine, {.voices = voices}, {}, patient_modes, {}, {}, {}, choice);
  REQUIRE(plan.parts.size() == 1);
  CHECK(form_name(plan.machine.parts[0].form) == plan.parts[0].form);
  return plan;
}

TEST_CASE("candidates are timed, and the cheapest is chosen", "[plan]") {
  const Machine machine = machine_of(picked);
  const std::string first = planned(machine, {}).parts[0].form;
  std::size_t others = 0;
  for (const std::string form : {"direct", "chains", "batch", "modal"}) {
    FakeClock clock{.ns = {{form, 100.0}}};
    const Timings timings = clock.timings();
    const Part part = planned(machine, {.timings = &timings}).parts[0];
    CAPTURE(form, first, part.reason);
    CHECK(clock.calls > 0);
    CHECK_FALSE(part.is_untimed);
    if (part.form == form) {
      CHECK(part.measured_ns == Approx(100.0));
      CHECK(describe({part}).find("measured 100 ns a sample for 1 voice on this machine") !=
            std::string::npos);
      others += form != first ? 1 : 0;
    } else {
      CHECK(part.form == first);  // its estimate was too far behind to be measured
      CHECK(part.measured_ns == Approx(1000.0));
    }
  }
  CHECK(others > 0);
}

TEST_CASE("a form that is less than a tenth cheaper does not replace the first in rank", "[plan]") {
  const Machine machine = machine_of(picked);
  const std::string first = planned(machine, {}).parts[0].form;
  for (const double ns : {920.0, 880.0}) {
    FakeClock clock;
    for (const std::string form : {"direct", "chains", "batch", "modal"}) {
      clock.ns[form] = form == first ? 1000.0 : ns;
    }
    const Timings timings = clock.timings();
    CHECK((planned(machine, {.timings = &timings}).parts[0].form == first) == (ns > 900.0));
  }
}

// The direct form steps eight voices with AVX-512 in twice the time of one; grid steps them one by
// one. One voice counts half as much as all of them.
TEST_CASE("a form that is cheap for one voice may take more for all", "[plan]") {
  const Machine machine = make_machine(
      *generate({.kind = ShapeKind::hexagon, .length = 20, .fixed = FixedPoints::border}), 44100.0,
      true);
  const Workload all{.isa = Isa::v4, .voices = 8};
  const Workload one{.isa = Isa::v4, .voices = 1};
  const Planned plan = make_plan(machine, all);
  CHECK(plan.parts[0].form == "grid");
  const Program& grid = plan.machine.parts[0];
  const Planned published = make_plan(machine, all, Method::direct);
  const Program& direct = published.machine.parts[0];
  CHECK(operations(grid, all) > operations(direct, all));
  CHECK(operations(grid, all) < 1.3 * operations(direct, all));
  CHECK(operations(grid, one) < 0.3 * operations(direct, one));
  CHECK(operations(grid, all) + 0.5 * operations(grid, one) <
        operations(direct, all) + 0.5 * operations(direct, one));
}

TEST_CASE("a measurement that is kept is not repeated", "[plan]") {
  const Machine machine = machine_of(picked);
  FakeClock clock{.ns = {{"direct", 100.0}}};
  const Timings timings = clock.timings();
  const Part measured = planned(machine, {.timings = &timings}).parts[0];
  const std::size_t calls = clock.calls;
  REQUIRE(calls > 0);
  const Part again = planned(machine, {.timings = &timings}).parts[0];
  CHECK(clock.calls == calls);
  CHECK(again.form == measured.form);
  CHECK(again.measured_ns == measured.measured_ns);
  CHECK(again.reason == measured.reason);
  // The number of voices is part of the key.
  planned(machine, {.timings = &timings}, 8);
  CHECK(clock.calls > calls);
  // The values of coefficients are not part of the key.
  const std::size_t before = clock.calls;
  const Machine stiffer = machine_of(picked + "@unused param 1.\n");
  planned(stiffer, {.timings = &timings});
  CHECK(clock.calls == before);
}

TEST_CASE("without a clock only results that are kept count", "[plan]") {
  const Machine machine = machine_of(picked);
  FakeClock clock{.ns = {{"direct", 100.0}}};
  const Timings timings = clock.timings();
  const Timings recalled{.time = {}, .recall = timings.recall, .keep = {}};
  const Part first = planned(machine, {.timings = &recalled}).parts[0];
  CHECK(first.form == planned(machine, {}).parts[0].form);
  CHECK(first.is_untimed);
  CHECK(first.measured_ns == 0.0);
  const Part measured = planned(machine, {.timings = &timings}).parts[0];
  const Part second = planned(machine, {.timings = &recalled}).parts[0];
  CHECK(second.form == measured.form);
  CHECK_FALSE(second.is_untimed);
  // Without any timings the plan is the same on every machine.
  CHECK_FALSE(planned(machine, {}).parts[0].is_untimed);
}

TEST_CASE("a plan repeats the forms of an earlier one", "[plan]") {
  const Machine machine = machine_of(picked);
  FakeClock clock{.ns = {{"direct", 100.0}}};
  const Timings timings = clock.timings();
  const Part measured = planned(machine, {.timings = &timings}).parts[0];
  REQUIRE(measured.form != planned(machine, {}).parts[0].form);
  const std::vector<std::string> forms{measured.form};
  CHECK(planned(machine, {.forms = forms}).parts[0].form == measured.form);
  const std::vector<std::string> unknown{"abacus"};
  CHECK(planned(machine, {.forms = unknown}).parts[0].form == planned(machine, {}).parts[0].form);
}

TEST_CASE("several steps a sample are measured in every form that steps them", "[plan]") {
  // Only more steps per sample keep a budget of cents with a cubic spring.
  const std::string bent = scenes::string("s", 12, "0.1", "0.001") +
                           "@b nlSpring3 @s_m2 @s_m7 0.05 0.5 0.\n@in1 frcInput @s_m3\n" +
                           scenes::output(1, "s_m4");
  const Machine machine = machine_of(bent);
  const Budget budget{.cents = 3.0};
  const auto plan = [&](const Choice& choice) {
    return make_plan(machine, {}, {}, 0, budget, {}, {}, choice).parts.at(0).form;
  };
  const std::string first = plan({});
  REQUIRE(first.starts_with("oversampled "));
  const std::string steps = first.substr(0, first.rfind(' ') + 1);
  const std::string other = first == steps + "direct" ? steps + "chains" : steps + "direct";
  FakeClock clock{.ns = {{other, 100.0}}};
  const Timings timings = clock.timings();
  CHECK(plan({.timings = &timings}) == other);
  const std::vector<std::string> forms{other};
  CHECK(plan({.forms = forms}) == other);
}

}  // namespace
}  // namespace ressort::plan_test
