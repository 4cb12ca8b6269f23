// The energy that the scheme conserves balances in every step.
#include "core/engine/energy.h"

#include "core/compile/plan.h"
#include "tests/support/networks/random_network.h"
#include "tests/support/player.h"

namespace ressort::energy_test {
namespace {

using support::show;

// A kernel with readable energy, and the energy that each step should have.
template <class T>
class Books {
 public:
  explicit Books(Program program) : bare(std::move(program)), inputs(bare.program().inputs.size()) {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const InputSlot& input = bare.program().inputs[i];
      inputs[i] = input.is_force ? 0.0 : bare.program().position[input.node];
    }
    read();
  }

  Energy energy() const {
    return energy_of(bare.program(), LaneValues<T>{bare_values(), width()}, x.data(), v.data());
  }

  // Runs one step. Afterwards `expected` is the old energy plus the work done in the step.
  void step() {
    const double booked = expected;
    const Program& program = bare.program();
    const std::vector<double> c = c_;  // before changes since the last step
    const std::vector<double> x0 = x;
    const std::vector<double> v0 = v;
    const std::vector<double> felt = link_forces(c);
    const std::vector<double> before = inputs;
    bare.step(inputs);
    read();
    const std::vector<double>& now = c_;
    const auto mean = [&](std::uint32_t node) { return 0.5 * (v[node] + v0[node]); };
    for (const MassRun& run : program.mass_runs) {
      const double dm = 1.0 / now[run.inverse_mass] - 1.0 / c[run.inverse_mass];
      const double k = run.is_oscillator ? now[run.stiffness] : 0.0;
      const double dk = run.is_oscillator ? k - c[run.stiffness] : 0.0;
      const double z = run.is_oscillator ? now[run.damping] : 0.0;
      const double dz = run.is_oscillator ? z - c[run.damping] : 0.0;
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        expected += 0.5 * x0[i] * dk * (x0[i] - v0[i]) - 0.25 * dz * v0[i] * v0[i] +
                    0.5 * dm * v0[i] * v0[i] - z * mean(i) * mean(i);
      }
    }
    each_spring([&](const LinkRun& run, std::uint32_t a, std::uint32_t b) {
      const double d = x[a] - x[b];
      const double speed = v[a] - v[b];
      const double z = c[run.coefficients[1]];
      const double dk = now[run.coefficients[0]] - c[run.coefficients[0]];
      expected += -z * (mean(a) - mean(b)) * (mean(a) - mean(b)) + 0.5 * d * dk * (d - speed) -
                  0.25 * (now[run.coefficients[1]] - z) * speed * speed;
    });
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      expected +=
          input.is_force ? mean(input.node) * static_cast<double>(static_cast<T>(inputs[i])) : 0.0;
    }
    for (std::uint32_t node = program.moving; node < x.size(); ++node) {
      const bool is_point = !program.taps.empty() && node >= program.taps[0].node;
      expected -=
          is_point ? 0.0
                   : felt[node] * mean(node);  // work of a driven position against the forces on it
    }
    passed += std::fabs(expected - booked);
    scale = std::max(scale, energy().scale);
  }

  support::Bare<T> bare;
  std::vector<double> inputs;
  std::vector<double> x, v;
  double expected = 0.0;
  double scale = 0.0;   // greatest energy
  double passed = 0.0;  // sum of the work in all steps

 private:
  std::size_t width() const { return width_; }
  const T* bare_values() const { return values_; }
  void read() {
    x.resize(bare.program().position.size());
    v.resize(x.size());
    REQUIRE(bare.kernel().save(0, x.data(), v.data()));
    width_ = bare.lanes();
    values_ = bare.kernel().coefficients.value.data();
    c_.resize(bare.program().coefficients.size());
    for (std::size_t c = 0; c < c_.size(); ++c) {
      c_[c] = static_cast<double>(values_[c * width_]);
    }
  }
  template <class Use>
  void each_spring(Use&& use) const {
    for (const LinkRun& run : bare.program().link_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        use(run, bare.program().ends[i].a, bare.program().ends[i].b);
      }
    }
  }
  std::vector<double> link_forces(const std::vector<double>& c) const {
    std::vector<double> force(x.size());
    each_spring([&](const LinkRun& run, std::uint32_t a, std::uint32_t b) {
      const double f =
          c[run.coefficients[0]] * (x[a] - x[b]) + c[run.coefficients[1]] * (v[a] - v[b]);
      force[a] -= f;
      force[b] += f;
    });
    return force;
  }

  std::size_t width_ = 1;
  const T* values_ = nullptr;
  std::vector<double> c_;  // [coefficient] in the last step
};

// Returns the largest unexplained share of the energy in a second of pushing, moving and parameter
// changes. In float it accumulates many roundings, each a share of the work done.
template <class T>
double unexplained(const std::string& text, Method method, std::uint64_t seed) {
  const Network network = support::network_of(text);
  const Machine machine = make_plan(make_machine(network, 44100.0, true),
                                    {.is_double = sizeof(T) == sizeof(double)}, method)
                              .machine;
  double worst = 0.0;
  for (const Program& program : machine.parts) {
    Books<T> books(program);
    support::Random random(seed);
    std::vector<support::Motion> motions;
    for (std::size_t i = 0; i < books.inputs.size(); ++i) {
      motions.emplace_back(seed + i, 20.0, 2000.0);
    }
    const std::vector<double> start = books.inputs;
    books.step();
    books.expected = books.energy().value;
    for (std::size_t n = 0; n < 44100; ++n) {
      if (n % 4410 == 0) {  // a jump or a ramp of all parameters at once
        std::vector<double> turned = program.parameters;
        for (std::size_t i = 0; i < turned.size(); ++i) {  // except a place, which would slide
          turned[i] *= network.parameters[i].name == "u" ? 1.0 : random.uniform(0.8, 1.2);
        }
        books.bare.set_coefficients(0, turned, random.uniform(0.9, 1.1), n % 8820 == 0);
        books.bare.kernel().coefficients.ramp(300);
      }
      for (std::size_t i = 0; i < books.inputs.size() && n < 22050; ++i) {
        books.inputs[i] = start[i] + 0.01 * motions[i](n);
      }
      books.step();
      const double all = books.scale + (sizeof(T) == sizeof(float) ? books.passed : 0.0) + 1e-30;
      worst = std::max(worst, std::fabs(books.energy().value - books.expected) / all);
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("Energy changes by the work done less the loss in dampers in every step", "[energy]") {
  const std::string hit = "@in1 frcInput @m_m1\n" + scenes::output(1, "m_m2");
  CHECK(unexplained<double>(scenes::triangle("0.1", "0.001") + hit, Method::direct, 1) < 1e-12);
  CHECK(unexplained<float>(scenes::triangle("0.1", "0.001") + hit, Method::direct, 1) < 1e-6);
  for (const Method method : {Method::direct, Method::chains}) {
    const double in_double = unexplained<double>(support::ringing_string(), method, 2);
    const double in_float = unexplained<float>(support::ringing_string(), method, 2);
    INFO(method_name(method) << " " << show(in_double) << " " << show(in_float));
    CHECK(in_double < 1e-12);
    CHECK(in_float < 1e-6);
  }
}

TEST_CASE("Energy balances in random networks", "[energy]") {
  int seen = 0;
  for (std::uint64_t seed = 1; seen < 24; ++seed) {
    const support::RandomNetwork network = support::random_network(seed);
    if (!network.is_linear || network.may_drift ||
        network.text.find("audioParam") != std::string::npos) {
      continue;
    }
    ++seen;
    const double in_double = unexplained<double>(network.text, Method::direct, seed);
    const double in_float = unexplained<float>(network.text, Method::direct, seed);
    INFO("seed " << seed << ", " << network.family << ": " << show(in_double) << " "
                 << show(in_float));
    CHECK(in_double < 1e-12);
    CHECK(in_float < 1e-6);
  }
}

// --- stability -----------------------------------------------------------------------------------

TEST_CASE("A model that starts out of bounds is silent at every note and never outputs NaN",
          "[energy]") {
  const std::string text =
      "@g ground 5.\n@m mass 2. 0.5 0.5\n@n mass 1. 1e300 -0.25\n@a spring @g @m 1020.\n"
      "@b spring @m @n 0.03 0.002\n@in1 frcInput @m\n@out1 posOutput @m\n@out2 posOutput @n\n";
  for (const bool bare : {false, true}) {
    support::Player player(text, support::struck(2), {.bare = bare, .force = true});
    std::vector<Event> notes;
    for (std::uint32_t frame = 0; frame < 20000; frame += 1000) {
      notes.push_back(support::note_on(frame, 60 + static_cast<int>(frame / 1000 % 7)));
    }
    player.run(20000, notes);
    for (const auto& channel : player.out) {
      CHECK(std::all_of(channel.begin(), channel.end(), [](double y) { return std::isfinite(y); }));
    }
  }
}

TEST_CASE("An unstable voice fades from its last sane sample without affecting other voices",
          "[energy]") {
  // The cubic spring is stable for a soft blow and unstable for a hard one.
  const std::string text =
      "@g ground 0.\n@m osc 1. 0.05 0.0001 0. 0.\n@c nlSpring3 @m @g 0. 1. 0.\n"
      "@in1 frcInput @m\n@out1 posOutput @m\n";
  Preset preset = support::struck(3);
  preset.controls[0].high = 100.0;
  for (const Precision precision : {Precision::float64, Precision::float32}) {
    const CompileOptions options{.precision = precision,
                                 .method = Method::direct,
                                 .budget = Budget{.passive = Passivity::never}};
    support::Player calm(text, preset, options);
    support::Player both(text, preset, options);
    constexpr std::uint32_t strike = 1001;
    calm.run(20000, {support::note_on(0, 60, 0.005)});
    both.run(20000, {support::note_on(0, 60, 0.005), support::note_on(strike, 55, 1.0)});
    CHECK(calm.engine().meters().resets == 0);
    CHECK(both.engine().meters().resets == 1);
    std::size_t last = 0;  // frame at which the unstable voice was last heard
    double steepest = 0.0;
    double before = 0.0;
    double most = 0.0;
    std::size_t lost = 0;  // frame at which the unstable voice is loudest
    for (std::size_t n = 0; n < 20000; ++n) {
      const double other = both.y()[n] - calm.y()[n];
      REQUIRE(std::isfinite(other));
      last = other != 0.0 ? n : last;
      lost = std::fabs(other) > most ? n : lost;
      most = std::max(most, std::fabs(other));
    }
    for (std::size_t n = lost + 1; n < 20000; ++n) {
      const double other = both.y()[n] - calm.y()[n];
      before = n == lost + 1 ? other : before;
      steepest = std::max(steepest, std::fabs(other - before));
      before = other;
    }
    const double fade = 0.005 * 44100.0;
    INFO(lost << " to " << last << ", " << show(most) << ", " << show(steepest));
    CHECK(lost >= strike);
    CHECK(most < runaway_level);
    CHECK(last < lost + static_cast<std::size_t>(fade) + max_block_frames + 2);
    CHECK(static_cast<double>(last) > static_cast<double>(lost) + fade - 2.0);
    CHECK(steepest < 1.001 * most / fade + 1e-6);
    for (std::size_t n = last + 1; n < 20000; ++n) {
      REQUIRE(both.y()[n] == calm.y()[n]);
    }
  }
}

// --- freezing -----------------------------------------------------------------------------------

namespace {

std::string quiet_string(const std::string& p, int output) {
  return scenes::string(p, 10, "0.1", "0.01") + "@in" + std::to_string(output) + " frcInput @" + p +
         "_m2\n" + scenes::output(output, p + "_m6");
}

Preset untuned() {
  Preset preset = support::struck(1);
  preset.keyboard = false;
  return preset;
}

Event blow(std::uint32_t frame, int input) {
  return {.frame = frame,
          .kind = EventKind::gesture,
          .gesture = Gesture::force,
          .index = static_cast<std::uint16_t>(input),
          .value = 0.1};
}

}  // namespace

TEST_CASE("A frozen part would have stayed inaudible", "[energy]") {
  const std::string text = quiet_string("s", 1);
  support::Player player(text, untuned(), {.method = Method::direct});
  support::Bare<double> never(support::program_of(text));
  CHECK(player.engine().meters().saved == 0.0);
  std::size_t slept = 0;
  double loudest = 0.0;  // peak of the skipped sound
  for (std::size_t n = 0; n < 10 * 44100; n += 64) {
    player.run(64, n == 0 ? std::vector<Event>{blow(0, 1)} : std::vector<Event>{});
    for (std::size_t i = n; i < n + 64; ++i) {
      const double y = never.step({i == 0 ? 0.1 : 0.0})[0];
      loudest = slept > 0 ? std::max(loudest, std::fabs(y)) : 0.0;
      REQUIRE(std::fabs(player.y()[i] - y) < 2e-6);
    }
    slept = slept == 0 && player.engine().meters().saved == 1.0 ? n + 64 : slept;
  }
  INFO("asleep after " << slept << ", then " << show(loudest));
  CHECK(slept > 0);
  CHECK(loudest < 1e-6);
  CHECK(loudest > 1e-9);  // the part could not have been frozen much earlier
  CHECK(player.heap_calls == 0);
}

TEST_CASE("A frozen part is unfrozen at the exact sample, part by part", "[energy]") {
  const std::string text = quiet_string("s", 1) + quiet_string("t", 2);
  const CompileOptions options{.method = Method::direct};
  support::Player fresh(text, untuned(), options);
  fresh.run(3000, {blow(0, 1), blow(0, 2)});
  for (const std::size_t input : {1u, 2u}) {
    support::Player player(text, untuned(), options);
    player.run(16384 + 37);
    CHECK(player.engine().meters().saved == 1.0);
    constexpr std::uint32_t frame = 1003;
    player.run(frame + 3000, {blow(frame, static_cast<int>(input))});
    CHECK(player.engine().meters().saved == 0.5);  // the other part stays frozen
    for (std::size_t n = 0; n < 3000; ++n) {
      REQUIRE(player.out[input - 1][16421 + frame + n] == fresh.out[input - 1][n]);
      REQUIRE(player.out[2 - input][16421 + frame + n] == 0.0);
    }
  }
  // A parameter change unfreezes the parts that depend on it.
  support::Player turned(text, untuned(), options);
  turned.run(16384);
  CHECK(turned.engine().meters().saved == 1.0);
  turned.run(256, {support::parameter(0, 1, 0.12)});
  CHECK(turned.engine().meters().saved == 0.5);
}

TEST_CASE("A part that could still touch something or drift is not frozen", "[energy]") {
  const std::string string =
      scenes::string("s", 10, "0.1", "0.01") + "@in1 frcInput @s_m2\n" + scenes::output(1, "s_m6");
  const auto saved = [](const std::string& text) {
    support::Player player(text, untuned(), {.method = Method::direct});
    player.run(16384);
    return player.engine().meters().saved;
  };
  CHECK(saved(string) == 1.0);
  CHECK(saved(string + "@w ground -0.1\n@c contact @w @s_m5 0.1 0. 0.\n") == 1.0);
  CHECK(saved(string + "@w ground 0.\n@c contact @w @s_m5 0.1 0. 0.\n") < 1.0);
  CHECK(saved(string + "@w ground 1.\n@l springDamper @w @s_m5 0.001 0.\n") < 1.0);
}

}  // namespace ressort::energy_test
