// Networks whose macros are never written out at once: the same bits as those that are.
#include "core/compile/large/excerpts.h"

#include "app/realtime/denormals.h"
#include "core/kernels/domains/one_by_one.h"
#include "core/kernels/domains/sharded.h"
#include "tests/support/player.h"

namespace ressort::excerpts_test {
namespace {

using namespace support;

// Who has a part of the machine in one place, and in a test plays as several.
class Workers final : public Executor {
 public:
  explicit Workers(std::size_t count) : count_(count) {}
  std::size_t size() const override { return count_; }
  bool is_live() const override { return false; }
  std::unique_ptr<Crew> gather(std::vector<Task*> tasks) override {
    return std::make_unique<OneByOne>(std::move(tasks));
  }

 private:
  std::size_t count_;
};

constexpr std::size_t frames = 400;

// Two strings and a mesh of 200,000 nodes, of which each is held somewhere: places beside the
// borders of shards, at both ends, near each other and in another macro's midst; a mass between
// two macros, a grounded one, a hand that plucks and one that bows.
std::string scene() {
  return "@k param 0.2\n@g ground 0.\n@in1 frcInput [@s 0.5001]\n@in2 posInput 0.\n"
         "@in3 posInput 0.\n"
         "@s string 120000 1. k 0.001 0.0001 0. 0.\n"
         "@t stiffString 30000 1.5 0.1 0.05 0.001 0. 0.\n"
         "@m cornerMesh 250 200 2. 0.1 0.002 0. 0.\n"
         "@w mass 3. 0.01 0.\n@o osc 2. 0.01 0.001 0.1 0.\n"
         "@ws springDamper @w [@s 0.5] 0.1 0.001\n@wt springDamper @w [@t 0.31] 0.07 0.\n"
         "@tm springDamper [@t 0.7] [@m 0.499 0.52] 0.03 0.001\n"
         "@os springDamper @o [@s 0.00002] 0.05 0.\n@og springDamper @o @g 0.02 0.\n"
         "@pick nlPluck @in2 [@s 0.50002] 0.05 0.01\n@bow nlBow @in3 [@m 0.5 0.5] 0.01 0.001\n"
         "@out1 posOutput [@s 0.5]\n@out2 posOutput [@s 0.50011]\n@out3 posOutput @w\n"
         "@out4 posOutput [@t 0.3101]\n@out5 posOutput [@m 0.5 0.51]\n@out6 posOutput @o\n"
         "@out7 frcOutput @g\n@out8 frcOutput [@s 0.5]\n@out9 posOutput [@s 0.00003]\n"
         "@out10 posOutput @in2\n";
}

Player played(const std::string& text, Precision precision, Executor* executor) {
  const DenormalsFlushed flushed;
  Player player(text, default_preset(network_of(text), true),
                {.bare = true, .precision = precision, .executor = executor});
  std::vector<std::vector<double>> inputs(3, std::vector<double>(frames));
  for (std::size_t n = 0; n < frames; ++n) {
    const auto t = static_cast<double>(n);
    inputs[0][n] = n < 20 ? 0.5 : 0.0;
    inputs[1][n] = 0.3 * std::sin(0.05 * t);
    inputs[2][n] = 0.1 * std::sin(0.03 * t);
  }
  const std::vector<const double*> channels = {inputs[0].data(), inputs[1].data(),
                                               inputs[2].data()};
  player.run(frames, {parameter(100, 0, 0.21), parameter(333, 0, 0.17)}, {256, 17}, channels);
  return player;
}

}  // namespace

TEST_CASE("macros that are never written out at once sound with the same bits", "[excerpts]") {
  const Precision precision = GENERATE(Precision::float64, Precision::float32);
  const Player whole = played(scene(), precision, nullptr);
  for (const std::size_t workers : {1u, 2u, 3u}) {
    INFO(workers << " workers");
    Workers executor(workers);
    const Player excerpts = played(scene(), precision, &executor);
    CHECK(excerpts.compiled.plan.parts.size() == 1);
    CHECK(excerpts.compiled.plan.parts[0].masses == whole.compiled.plan.parts[0].masses);
    CHECK(excerpts.compiled.plan.parts[0].links == whole.compiled.plan.parts[0].links);
    CHECK(excerpts.compiled.plan.parts[0].reason.find("shards") != std::string::npos);
    REQUIRE(excerpts.out.size() == whole.out.size());
    for (std::size_t i = 0; i < whole.out.size(); ++i) {
      INFO("output " << i + 1);
      CHECK(peak(whole.out[i]) > 0.0);
      CHECK(excerpts.out[i] == whole.out[i]);
    }
  }
}

TEST_CASE("what is not alike everywhere is written out", "[excerpts]") {
  const std::vector<double> nothing;
  const auto is_excerpted = [&](const std::string& text) {
    return Excerpts::of(network_of(text), nothing, 1.0).has_value();
  };
  const std::string string = "@s string 100000 1. 0.2 0.001 0. 0.\n@out1 posOutput [@s 0.5]\n";
  CHECK(is_excerpted(string));
  CHECK_FALSE(is_excerpted("@s string 99999 1. 0.2 0.001 0. 0.\n@out1 posOutput [@s 0.5]\n"));
  CHECK_FALSE(is_excerpted(string + "@t string 100 1. 0.2 0.001 0. 0.\n"));  // nobody hears it
  CHECK_FALSE(is_excerpted(string + "@m mass 1. 0. 0.\n@l spring @m [@s 0.3] -0.1\n"));
  CHECK_FALSE(is_excerpted(string + "@m mass 0.01 0. 0.\n@l spring @m [@s 0.3] 0.1\n"));
  CHECK(is_excerpted(string + "@m mass 1. 0. 0.\n@l spring @m [@s 0.3] 0.1\n"));
  CHECK_FALSE(is_excerpted("@s string 100000 1. 1.001 0. 0. 0.\n@out1 posOutput [@s 0.5]\n"));
}

}  // namespace ressort::excerpts_test
