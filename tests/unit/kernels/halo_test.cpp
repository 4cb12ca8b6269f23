// Large networks in shards: the output equals that of the whole network.
#include "app/realtime/denormals.h"
#include "app/realtime/thread_pool.h"
#include "core/kernels/chains/chains_form.h"
#include "core/kernels/direct/direct_form.h"
#include "core/kernels/domains/shards.h"
#include "core/kernels/grid/grid_form.h"
#include "core/laws/laws.h"
#include "tests/support/comparison.h"

namespace ressort::halo_test {

using namespace support;

namespace {

struct Cut {
  std::size_t shards = 2;
  std::uint32_t frames = 64;
};
const Cut cuts[] = {{2, 64}, {3, 64}, {3, 7}};
const Cut mesh_cuts[] = {{2, 10}, {3, 6}};  // Each shard lacks a large part of the network.

// Returns the Program in shards, each in the form that `reform` chooses.
template <class Reform>
Program sharded(Program program, const Cut& cut, Executor& executor, Reform&& reform) {
  auto shards = std::make_shared<std::vector<Shard>>(make_shards(program, cut.shards, cut.frames));
  REQUIRE(shards->size() == cut.shards);
  for (Shard& shard : *shards) {
    auto form = reform(shard.program);
    REQUIRE(form);
    shard.program.form = *std::move(form);
  }
  program.form = Shards{.shards = std::move(shards), .executor = &executor, .frames = cut.frames};
  return program;
}
std::optional<Chains> as_chains(const Program& program) {
  return chains_form(program);
}
std::optional<Grid> as_grid(const Program& program) {
  return grid_form(program);
}
std::optional<Direct> as_it_is(const Program&) {
  return Direct{};
}

// A chain of 2000 masses that ends at a moving position input, with a finger, a bow and a force.
// Outputs are at both ends, beside both cuts of three shards, and as forces on the ground and on
// two masses.
std::string chain_scene() {
  return scenes::string("s", 2000, "0.3", "0.002") +
         "@in1 posInput 0.\n@in2 posInput 0.\n@in3 frcInput @s_m668\n"
         "@hand springDamper @in1 @s_m3 0.1 0.01\n" +
         scenes::touch("finger", "s_m1001", 2) +
         "@bow nlBow @in2 @s_m990 0.005 0.01 1\n@w osc 2. 0.01 0.001 0. 0.\n"
         "@tie springDamper @w @s_m500 0.02 0.\n" +
         scenes::output(1, "s_m1") + scenes::output(2, "s_m667") + scenes::output(3, "s_m999") +
         scenes::output(4, "s_m1000") + scenes::output(5, "s_m1999") + scenes::output(6, "w");
}
std::string heard_forces() {
  return "@out7 frcOutput @s_s1\n@out8 frcOutput @s_m999\n@out9 frcOutput @s_m668\n";
}
std::string heard_holds() {
  return "@out10 posOutput @in1\n@out11 posOutput @s_s0\n";
}

// 45 x 45 points held at two corners, with a finger above the cut of two shards.
std::string mesh_scene() {
  return scenes::square_mesh("p", 45, 45, "0.2", "0.003") +
         "@in1 frcInput @p_m10_11\n@in2 posInput 0.\n" + scenes::touch("finger", "p_m22_30", 2) +
         scenes::output(1, "p_m44_3") + scenes::output(2, "p_m22_21") +
         scenes::output(3, "p_m10_12");
}

// Returns one Comparison for each output of two Programs, whose forms may differ, over 3000
// samples.
template <class T>
std::vector<Comparison> compare(const Program& whole, const Program& cut, Isa isa, bool turns) {
  const DenormalsFlushed flushed;  // as in the executor's threads
  KernelRunner<T> expected(whole, 1.0, isa);
  KernelRunner<T> found(cut, 1.0, isa);
  Random random(3);
  std::vector<Motion> motions;
  for (std::size_t i = 0; i < whole.inputs.size(); ++i) {
    motions.emplace_back(7 + i, 20.0, 2000.0);
  }
  std::vector<Comparison> outputs(whole.outputs.size());
  for (std::size_t at = 0; at < 3000;) {
    const std::size_t frames = random.below(3) == 0 ? 1 + random.below(64) : 64;
    std::vector<std::vector<double>> inputs(frames);
    for (std::size_t n = 0; n < frames; ++n) {
      for (const Motion& motion : motions) {
        inputs[n].push_back(0.1 * motion(at + n));
      }
    }
    if (turns && random.below(5) == 0) {
      std::vector<double> parameters = whole.parameters;
      for (double& parameter : parameters) {
        parameter *= random.uniform(0.9, 1.1);
      }
      expected.turn(parameters, 1.0, true);
      found.turn(parameters, 1.0, true);
    }
    const auto wanted = expected.play(inputs);
    const auto got = found.play(inputs);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      outputs[i % outputs.size()].add(wanted[i], got[i]);
    }
    at += frames;
  }
  return outputs;
}

// Checks for equal bits in the direct form.
template <class T>
void check_same(Program program, const Cut& cut, Executor& executor, Isa isa, bool turns) {
  INFO(cut.shards << " shards, " << cut.frames << " frames, " << isa_name(isa));
  double peak = 0.0;
  for (const Comparison& output :
       compare<T>(program, sharded(program, cut, executor, as_it_is), isa, turns)) {
    CHECK(output.worst == 0.0);
    peak = std::max(peak, output.peak);
  }
  CHECK(peak > 0.01);
}

}  // namespace

TEST_CASE("in the direct form shards compute the same bits", "[halo]") {
  ThreadPool executor(3);
  const bool turns = GENERATE(false, true);
  const auto check = [&](const std::string& text, const auto& all_cuts) {
    const Program program = program_of(text);
    for (const Cut& cut : all_cuts) {
      check_same<double>(program, cut, executor, Isa::base, turns);
      check_same<float>(program, cut, executor, best_isa(), turns);
    }
  };
  check(chain_scene() + heard_forces() + heard_holds(), cuts);
  check(mesh_scene(), mesh_cuts);
}

// The shards' kernels are not initialised yet; masses 295 to 304 have copies in both.
TEST_CASE("a network in shards is struck before its first step", "[halo]") {
  ThreadPool executor(2);
  const Program program =
      program_of(scenes::string("s", 600, "0.1", "0.001") + "@out1 posOutput @s_m300\n");
  for (const std::uint32_t struck : {10u, 295u, 299u, 304u}) {
    Bare<double> whole(program);
    Bare<double> shards(sharded(program, {2, 16}, executor, as_it_is));
    const std::vector<std::uint32_t> node = {struck};
    const std::vector<double> change = {0.01};
    whole.kernel().strike(0, node, change);
    shards.kernel().strike(0, node, change);
    double peak = 0.0;
    for (std::size_t n = 0; n < 2000; ++n) {
      const double expected = whole.step({})[0];
      REQUIRE(shards.step({})[0] == expected);
      peak = std::max(peak, std::fabs(expected));
    }
    CHECK(peak > 0.001);
  }
}

TEST_CASE("points on macros and unordered networks are divided too", "[halo]") {
  ThreadPool executor(3);
  const std::string macro =
      "@k param 0.2\n@p closedMesh 45 46 1. k 0.003 0. 0.\n@in1 frcInput [@p 0.49 0.3]\n"
      "@in2 posInput 0.\n@finger contact [@p 0.503 0.8] @in2 0. 0.01 0.\n"
      "@out1 posOutput [@p 0.51 0.7]\n@out2 posOutput [@p 0.1 0.1]\n@out3 frcOutput [@p 0.497 "
      "0.51]\n";
  for (const Cut& cut : mesh_cuts) {
    check_same<double>(program_of(macro), cut, executor, Isa::base, true);
  }

  for (const std::uint64_t seed : {1u, 2u}) {
    INFO("seed " << seed);
    Random random(seed);
    std::string text = "@k param 0.02\n@g ground 0.1\n@in1 frcInput @m17\n@in2 posInput 0.\n";
    constexpr int masses = 2000;
    for (int i = 0; i < masses; ++i) {
      text += scenes::at("m", i) +
              (random.below(3) == 0 ? " osc 1. 0.01 0.001 0. 0.\n" : " mass 2. 0. 0.\n");
    }
    const auto mass = [&](std::size_t i) { return scenes::at("m", static_cast<int>(i)); };
    for (std::size_t i = 0; i < 4000; ++i) {
      const std::size_t a = random.below(masses - 5);
      const std::string other = random.below(50) == 0 ? "@g" : mass(a + 1 + random.below(4));
      text += "@l" + std::to_string(i) +
              (random.below(4) == 0 ? " nlSpring3 " + mass(a) + " " + other + " 0.01 0.01 0.001\n"
                                    : " springDamper " + mass(a) + " " + other + " k 0.001\n");
    }
    text +=
        "@f contact @m1003 @in2 0.1 0.01 0.\n@out1 posOutput @m20\n@out2 posOutput @m1002\n"
        "@out3 frcOutput @g\n@out4 frcOutput @m999\n";
    for (const Cut& cut : {Cut{2, 32}, Cut{3, 16}}) {
      check_same<double>(program_of(text), cut, executor, Isa::base, false);
    }
  }
}

TEST_CASE("chains and grids in shards match the direct form", "[halo]") {
  ThreadPool executor(3);
  ComparisonOptions options{.frames = 8820, .seed = 5, .reach = 0.05};
  const auto check = [&](const std::string& text, const std::string& forces, const auto& all_cuts,
                         auto&& reform) {
    const Program program = program_of(text);
    for (const Cut& cut : all_cuts) {
      INFO(cut.shards << " shards, " << cut.frames << " frames, " << isa_name(options.isa)
                      << (options.turns ? ", turns" : ""));
      for (const auto& output :
           compare_kernels<double>(sharded(program, cut, executor, reform), options)) {
        INFO(show(output.relative()));
        CHECK(output.relative() < 1e-12);
      }
      // Forces are small differences of positions, so they are compared with the same form.
      Program whole = program_of(text + forces);
      const Program shards = sharded(whole, cut, executor, reform);
      whole.form = *reform(whole);
      for (const auto& output : compare<double>(whole, shards, options.isa, options.turns)) {
        INFO(show(output.relative()));
        CHECK(output.relative() < 1e-13);
      }
    }
  };
  for (const Isa isa : isas()) {
    options.isa = isa;
    for (const bool turns : {false, true}) {
      options.turns = turns;
      check(chain_scene(), heard_forces(), cuts, as_chains);
      check(mesh_scene(), "", mesh_cuts, as_grid);
    }
  }
}

TEST_CASE("a grid with a law on every link is divided into shards", "[halo]") {
  ThreadPool executor(2);
  const Program program = program_of(
      "@k param 0.1\n@p closedMesh 45 45 1. k 0.003 0. 0.\n@in1 frcInput [@p 0.3 0.31]\n"
      "@out1 posOutput [@p 0.7 0.1]\n@out2 posOutput [@p 0.503 0.5]\n");
  Program cubic = program;
  for (LinkRun& run : cubic.link_runs) {
    run.law = Law::cubic_spring;
    run.coefficients[2] = run.coefficients[1];
    run.coefficients[1] = run.coefficients[0];
  }
  for (const auto& output :
       compare_kernels<double>(sharded(cubic, {2, 10}, executor, as_grid),
                               {.frames = 8820, .reach = 2.0, .turns = true})) {
    INFO(show(output.relative()));
    CHECK(output.relative() < 1e-12);
  }
}

// At K = M a wave on a string has the highest possible speed, one link per sample.
TEST_CASE("a wave passes from one shard to the next unchanged", "[halo]") {
  ThreadPool executor(2);
  const Program program =
      program_of(scenes::string("s", 600, "1", "0") +
                 "@in1 frcInput @s_m200\n@out1 posOutput @s_m300\n@out2 posOutput @s_m400\n");
  const auto played = [&](Program playing) {
    KernelRunner<double> fighter(playing, 1.0, Isa::base);
    std::vector<double> heard;
    for (std::size_t block = 0; block < 4; ++block) {
      std::vector<std::vector<double>> inputs(64, {0.0});
      inputs[0][0] = block == 0 ? 1.0 : 0.0;
      const auto more = fighter.play(inputs);
      heard.insert(heard.end(), more.begin(), more.end());
    }
    return heard;
  };
  const std::vector<double> heard = played(sharded(program, {2, 64}, executor, as_it_is));
  for (std::size_t n = 0; n < 256; ++n) {
    // An impulse of 1 leaves a step of 1 at every second mass behind its front.
    const auto step = [&](std::size_t links) {
      return n >= links && (n - links) % 2 == 0 ? 1.0 : 0.0;
    };
    CHECK(heard[2 * n] == step(100));
    CHECK(heard[2 * n + 1] == step(200));
  }

  // The copies cover the neighbourhood of 16 samples, so 64 samples are too many.
  Program narrow = sharded(program, {2, 16}, executor, as_it_is);
  CHECK(played(narrow) == heard);
  Shards wider = narrow.form.get<Shards>();
  wider.frames = 64;
  narrow.form = std::move(wider);
  CHECK(played(narrow) != heard);
}

// 10 s of a string without damping: 6900 exchanges.
TEST_CASE("shards do not drift", "[halo]") {
  ThreadPool executor(2);
  Program program = program_of(scenes::string("s", 2000, "0.3", "0") +
                               "@in1 frcInput @s_m20\n@out1 posOutput @s_m1700\n");
  Program cut = sharded(program, {2, 64}, executor, as_chains);
  program.form = *chains_form(program);
  KernelRunner<double> whole(program, 1.0, best_isa());
  KernelRunner<double> shards(cut, 1.0, best_isa());
  Comparison last_second;
  for (std::size_t block = 0; block < 6900; ++block) {
    std::vector<std::vector<double>> inputs(64, {0.0});
    inputs[0][0] = block == 0 ? 1.0 : 0.0;
    const auto expected = whole.play(inputs);
    const auto found = shards.play(inputs);
    for (std::size_t n = 0; block >= 6200 && n < 64; ++n) {
      last_second.add(expected[n], found[n]);
    }
  }
  INFO(show(last_second.relative()));
  CHECK(last_second.peak > 0.1);
  CHECK(last_second.relative() < 1e-11);
}

TEST_CASE("a network is divided into shards if that pays", "[halo]") {
  ThreadPool executor(2);
  const auto planned = [&](const std::string& text, Executor* helpers,
                           std::optional<Method> method) {
    const auto [machine, parts, more] = make_plan(make_machine(network_of(text), 44100.0, true),
                                                  {.isa = Isa::v3, .executor = helpers}, method);
    INFO(describe(parts));
    const auto* const shards = machine.parts[0].form.get_if<Shards>();
    if (shards != nullptr) {
      const std::string count = std::to_string(shards->shards->size());
      CHECK(describe(parts).find(" " + count + " shards") != std::string::npos);
    }
    return shards == nullptr ? 0 : static_cast<int>(shards->shards->size());
  };
  const std::string string = "@s string 4000 1. 0.1 0.001 0. 1.\n@out1 posOutput [@s 0.3]\n";
  const std::string mesh = "@s mesh 200 200 1. 0.1 0.001 0. 1.\n@out1 posOutput [@s 0.3 0.3]\n";
  CHECK(planned(string, &executor, {}) == 2);
  CHECK(planned(mesh, &executor, {}) == 2);
  CHECK(planned(string, &executor, Method::direct) == 2);
  CHECK(planned(string, nullptr, {}) == 0);
  CHECK(planned("@s string 1000 1. 0.1 0.001 0. 1.\n@out1 posOutput [@s 0.3]\n", &executor, {}) ==
        0);
  // A mass takes 32 bytes. Each core gets the same number of shards, of at most 48 KiB each.
  const std::string long_string = "@s string 30000 1. 0.1 0.001 0. 1.\n@out1 posOutput [@s 0.3]\n";
  CHECK(planned(long_string, &executor, {}) == 20);
  CHECK(planned(long_string, nullptr, {}) == 20);
  CHECK(planned(long_string, &executor, Method::direct) == 2);
  // A finger that may move to any place depends on all masses.
  CHECK(planned(string + "@u param 0.5\n@in1 frcInput [@s u]\n", &executor, {}) == 0);
  CHECK(planned(string + "@in1 frcInput [@s 0.5]\n", &executor, {}) == 2);
}

TEST_CASE("one core steps a network in shards if it exceeds the caches", "[halo]") {
  const std::string text =
      "@s string 300000 1. 0.1 0.001 0. 0. 0.\n@in1 frcInput [@s 0.2]\n"
      "@out1 posOutput [@s 0.20001]\n@out2 posOutput [@s 0.2]\n";
  const Machine machine = make_machine(network_of(text), 44100.0, true);
  const Planned planned = make_plan(machine, {.isa = best_isa()}, Method::chains);
  const Program& cut = planned.machine.parts[0];
  const auto* const shards = cut.form.get_if<Shards>();
  REQUIRE(shards != nullptr);
  CHECK(shards->shards->size() == 196);  // 32 bytes per mass, in shards of at most 48 KiB
  CHECK(describe(planned.parts).find("196 shards one after the other") != std::string::npos);
  const Planned grid = make_plan(machine, {.isa = best_isa()}, Method::grid);
  const auto* const wide = grid.machine.parts[0].form.get_if<Shards>();
  REQUIRE(wide != nullptr);
  CHECK(wide->shards->size() == 10);  // in shards of at most 1 MiB
  Program whole = machine.parts[0];
  whole.form = *chains_form(whole);
  KernelRunner<double> together(whole, 1.0, best_isa());
  KernelRunner<double> apart(cut, 1.0, best_isa());
  Comparison comparison;
  for (std::size_t block = 0; block < 8; ++block) {
    std::vector<std::vector<double>> inputs(64, {0.0});
    inputs[0][0] = block == 0 ? 1.0 : 0.0;
    const auto expected = together.play(inputs);
    const auto found = apart.play(inputs);
    for (std::size_t n = 0; n < 64; ++n) {
      comparison.add(expected[n], found[n]);
    }
  }
  INFO(show(comparison.relative()));
  CHECK(comparison.peak > 0.1);
  CHECK(comparison.relative() < 1e-13);
}

TEST_CASE("set_state and save work for kernels in shards", "[halo]") {
  ThreadPool executor(2);
  const Program program = program_of(chain_scene());
  const Program cut = sharded(program, {2, 16}, executor, as_chains);
  const auto kernel = make_kernel<double>(cut, 1, best_isa());
  CHECK(kernel->is_near_start(0, 1e-9));
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  for (std::size_t node = 0; node < x.size(); ++node) {
    x[node] = static_cast<double>(node);
    v[node] = -0.5 * static_cast<double>(node);
  }
  kernel->set_state(0, x.data(), v.data());
  CHECK_FALSE(kernel->is_near_start(0, 1e-9));
  std::vector<double> saved_x(x.size());
  std::vector<double> saved_v(x.size());
  REQUIRE(kernel->save(0, saved_x.data(), saved_v.data()));
  CHECK(saved_x == x);
  CHECK(saved_v == v);
}

}  // namespace ressort::halo_test
