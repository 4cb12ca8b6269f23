// Sleeping modes: the kernel computes fewer modes, and the error never exceeds the reported bound.
#include <fstream>
#include <sstream>

#include "core/kernels/modal/modal.h"
#include "core/kernels/modal/modal_form.h"
#include "tests/support/comparison.h"

namespace ressort::modes_asleep_test {
namespace {

using support::isas;
using support::KernelRunner;
using support::network_of;
using support::show;

// All modes are awake until the first check after a blow; the share of a second that it lasts.
constexpr double share_of_first_check = check_frames / 44100.0;

std::string model(const std::string& name) {
  std::ifstream file(std::string(RESSORT_SOURCE) + "/models/" + name);
  std::stringstream text;
  text << file.rdbuf();
  REQUIRE(!text.str().empty());
  return text.str();
}

Program in_modes(const std::string& text, double silence_db) {
  Program program = make_program(network_of(text), 44100.0, true);
  std::optional<Modes> modes = modal_form(program, {.silence_db = silence_db});
  REQUIRE(modes);
  program.form = std::move(*modes);
  return program;
}

// All modes awake; either those that a budget leaves, or all that exist.
Program wide_awake(Program program) {
  Modes modes = program.form.get<Modes>();
  modes.silence = 0.0;
  program.form = std::move(modes);
  return program;
}

// A program with sleeping modes and the same program with all modes awake, with the same inputs.
template <class T = double>
class Pair {
 public:
  Pair(const std::string& text, double silence_db, Isa isa = best_isa())
      : program_(in_modes(text, silence_db)),
        sleepy_(program_, 1.0, isa),
        full_(wide_awake(program_), 1.0, isa),
        unreduced_(in_modes(text, -Budget::unlimited), 1.0, isa) {}

  // Plays at most nap_frames. Checks every output against the error that the kernel with sleeping
  // modes reports.
  void play(const std::vector<std::vector<double>>& inputs) {
    std::vector<double> owed;
    for (std::size_t o = 0; o < outputs(); ++o) {
      owed.push_back(this->owed(o));
    }
    const auto found = sleepy_.play(inputs);
    const auto wanted = full_.play(inputs);
    const auto all = unreduced_.play(inputs);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      reduced_ = std::max(reduced_, std::fabs(found[i] - all[i]));
      const std::size_t o = i % outputs();
      const double off = std::fabs(found[i] - wanted[i]);
      peak_ = std::max(peak_, std::fabs(wanted[i]));
      worst_ = std::max(worst_, off);
      const double bound = std::max(owed[o], this->owed(o));
      most_owed_ = std::max(most_owed_, bound);
      excess_ = std::max(excess_, off - bound);
    }
    frames_ += inputs.size();
    sum_awake_ += static_cast<double>(awake() * inputs.size());
  }
  void rest(std::size_t frames) {
    const std::vector<double> none(program_.inputs.size(), 0.0);
    for (std::size_t at = 0; at < frames; at += 30) {
      play(std::vector<std::vector<double>>(std::min<std::size_t>(30, frames - at), none));
    }
  }
  void turn(const std::vector<double>& parameters, double pitch) {
    sleepy_.turn(parameters, pitch, true);
    full_.turn(parameters, pitch, true);
    unreduced_.turn(parameters, pitch, true);
  }

  std::size_t outputs() const { return program_.outputs.size(); }
  std::size_t awake() const { return kernel().awake().modes; }
  std::size_t modes() const { return kernel().awake().of; }
  double mean_awake() const { return sum_awake_ / static_cast<double>(frames_); }
  double peak() const { return peak_; }
  double worst() const { return worst_; }
  double most_owed() const { return most_owed_; }
  double excess() const { return excess_; }    // largest ratio of error to bound
  double reduced() const { return reduced_; }  // the same, compared with all modes of the network
  const Program& program() const { return program_; }
  const Modes& form() const { return program_.form.get<Modes>(); }

 private:
  const ModalKernel<T>& kernel() const {
    return dynamic_cast<const ModalKernel<T>&>(sleepy_.kernel());
  }
  double owed(std::size_t output) const { return kernel().owed(form().places.size() + output); }

  Program program_;
  KernelRunner<T> sleepy_;
  KernelRunner<T> full_;
  KernelRunner<T> unreduced_;
  std::size_t frames_ = 0;
  double sum_awake_ = 0.0;
  double peak_ = 0.0;
  double worst_ = 0.0;
  double reduced_ = 0.0;
  double most_owed_ = 0.0;
  double excess_ = -1.0;
};

// Returns an upper bound for the output amplitude of all modes together after a strike of 1.
double reach_of_a_blow(const std::string& text) {
  const Modes modes = in_modes(text, -Budget::unlimited).form.get<Modes>();
  double most = 0.0;
  for (const ModalOutput& output : modes.outputs) {
    double sum = 0.0;
    for (std::size_t i = 0; i < modes.modes; ++i) {
      const double k = 0.1 * modes.stiffness[0].factor[i];
      sum += std::fabs(modes.pushes[0].shape[i] * output.place.shape[i]) / std::sqrt(0.75 * k);
    }
    most = std::max(most, sum);
  }
  return most;
}

TEST_CASE("A struck mesh keeps ten of six hundred modes awake", "[modes_asleep]") {
  const std::string struck = model("20x30mesh.mdl");
  const double reach = reach_of_a_blow(struck);
  for (const Isa isa : isas()) {
    Pair mesh(struck, -60.0, isa);
    mesh.play({{1.0}});
    CHECK(mesh.awake() == mesh.modes());
    mesh.rest(44099);
    INFO("mean " << mesh.mean_awake() << " of " << mesh.modes() << ", off by " << show(mesh.worst())
                 << " of " << show(mesh.peak()) << ", at most " << show(mesh.most_owed()) << ", "
                 << isa_name(isa));
    CHECK(mesh.form().of > 590);
    CHECK(mesh.mean_awake() <= 10.0 + share_of_first_check * static_cast<double>(mesh.modes()));
    CHECK(mesh.excess() < 1e-12);
    CHECK(mesh.worst() > 0.0);
    CHECK(mesh.most_owed() + mesh.form().left_out * reach <= 1e-3 * reach);
    CHECK(mesh.reduced() <= mesh.most_owed() + mesh.form().left_out * reach);
  }
}

TEST_CASE("A smaller silence budget keeps fewer modes awake", "[modes_asleep]") {
  const double reach = reach_of_a_blow(model("20x30mesh.mdl"));
  double before = 0.0;
  for (const double silence : {-40.0, -60.0, -80.0, -100.0}) {
    Pair mesh(model("20x30mesh.mdl"), silence);
    mesh.play({{1.0}});
    mesh.rest(20000);
    CHECK(mesh.mean_awake() > before);
    CHECK(mesh.excess() < 1e-12);
    CHECK(mesh.reduced() <= std::pow(10.0, silence / 20.0) * reach);
    before = mesh.mean_awake();
  }
}

TEST_CASE("A strike wakes all modes in its own sample", "[modes_asleep]") {
  Pair mesh(model("20x30mesh.mdl"), -60.0);
  mesh.play({{1.0}});
  for (const std::size_t wait : {30000u, 12345u, 7u, 20001u}) {
    mesh.rest(wait);
    if (wait > 10000) {
      CHECK(mesh.awake() < 12);
    }
    // A strike in the middle of a block.
    mesh.play({{0.0}, {0.0}, {0.0}, {-0.7}, {0.0}});
    CHECK(mesh.awake() == mesh.modes());
  }
  mesh.rest(30000);
  CHECK(mesh.excess() < 1e-12);
}

TEST_CASE("Parameters and pitch may change while modes sleep", "[modes_asleep]") {
  Pair mesh(model("20x30mesh.mdl"), -60.0);
  mesh.play({{1.0}});
  mesh.rest(20000);
  const std::vector<double> start = mesh.program().parameters;
  for (const double factor : {0.5, 0.9, 0.3, 1.0}) {
    std::vector<double> turned = start;
    turned[1] *= factor;        // K
    turned[2] *= 2.0 - factor;  // Z
    const std::size_t asleep = mesh.awake();
    CHECK(asleep < 20);
    mesh.turn(turned, 1.0 / factor);
    mesh.rest(60);
    CHECK(mesh.awake() > asleep);
    mesh.rest(10000);
  }
  CHECK(mesh.excess() < 1e-12);
  CHECK(mesh.awake() < 20);
}

// A finger that touches a mesh now and then.
std::string touched_mesh() {
  return scenes::square_mesh("m", 8, 9, "0.1", "0.02") +
         "@in1 posInput 1.\n@t1 contact @m_m2_3 @in1 0.05 0.01 0.\n@in2 frcInput @m_m6_2\n" +
         scenes::output(1, "m_m3_3") + scenes::output(2, "m_m7_1");
}

TEST_CASE("A contact wakes modes like a strike", "[modes_asleep]") {
  for (const Isa isa : isas()) {
    Pair mesh(touched_mesh(), -60.0, isa);
    double finger = 1.0;
    for (std::size_t at = 0; at < 40000; at += 25) {
      std::vector<std::vector<double>> inputs;
      for (std::size_t n = at; n < at + 25; ++n) {
        const double t = static_cast<double>(n % 10000);
        finger = t < 500.0 ? 0.5 + 0.7 * std::cos(0.0125 * t) : 1.0;
        inputs.push_back({finger, n == 3 ? 1.0 : 0.0});
      }
      mesh.play(inputs);
    }
    INFO(mesh.mean_awake() << " of " << mesh.modes() << ", off by " << show(mesh.worst()) << " of "
                           << show(mesh.peak()));
    CHECK(mesh.mean_awake() < 0.5 * static_cast<double>(mesh.modes()));
    // The finger responds to the error too, so the bound for free motion no longer holds. The sound
    // does not differ audibly.
    CHECK(mesh.worst() < 1e-3 * mesh.peak());
    CHECK(mesh.worst() > 0.0);
  }
}

TEST_CASE("Sleeping modes keep the bound in float and in double", "[modes_asleep]") {
  Pair<float> mesh(model("20x30mesh.mdl"), -60.0);
  mesh.play({{1.0}});
  mesh.rest(44099);
  CHECK(mesh.mean_awake() <= 10.0 + share_of_first_check * static_cast<double>(mesh.modes()));
  CHECK(mesh.excess() < 1e-6 * mesh.peak());
}

TEST_CASE("Exact modes sleep, too", "[modes_asleep]") {
  const std::string text = model("20x30mesh.mdl");
  Program full = make_program(network_of(text), 44100.0, true);
  Program sleepy = full;
  full.form = *modal_form(full, {.cents = 1.0});
  sleepy.form = *modal_form(sleepy, {.cents = 1.0, .silence_db = -60.0});
  KernelRunner<double> one(full, 1.0, best_isa());
  KernelRunner<double> other(sleepy, 1.0, best_isa());
  const double reach = reach_of_a_blow(text);
  double sum = 0.0;
  for (std::size_t at = 0; at < 44100; at += 60) {
    std::vector<std::vector<double>> inputs(60, {0.0});
    inputs[0][0] = at == 0 ? 1.0 : 0.0;
    if (at == 24000) {
      std::vector<double> turned = full.parameters;
      turned[1] *= 0.6;
      one.turn(turned, 1.0, true);
      other.turn(turned, 1.0, true);
    }
    const auto wanted = one.play(inputs);
    const auto found = other.play(inputs);
    const auto& kernel = dynamic_cast<const ModalKernel<double>&>(other.kernel());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      CHECK(std::fabs(found[i] - wanted[i]) < 1e-3 * reach);
    }
    sum += 60.0 * static_cast<double>(kernel.awake().modes);
  }
  const double all = static_cast<double>(sleepy.form.get<Modes>().modes);
  CHECK(sum / 44100.0 <
        12.0 + 2.0 * share_of_first_check * all);  // a blow and a turned knob wake all
}

TEST_CASE("Without a budget no mode sleeps", "[modes_asleep]") {
  Pair mesh(model("20x30mesh.mdl"), -Budget::unlimited);
  mesh.play({{1.0}});
  mesh.rest(20000);
  CHECK(mesh.awake() == mesh.modes());
  CHECK(mesh.worst() == 0.0);
}

TEST_CASE("A reset voice has all modes awake", "[modes_asleep]") {
  support::Bare<double> bare(in_modes(model("20x30mesh.mdl"), -60.0));
  const auto play = [&] {
    std::vector<double> heard;
    for (std::size_t n = 0; n < 5000; ++n) {
      heard.push_back(bare.step({n == 1 ? 1.0 : 0.0})[0]);
    }
    return heard;
  };
  const auto first = play();
  CHECK(bare.kernel().awake().modes < 50);
  bare.kernel().reset(0);
  CHECK(bare.kernel().awake().modes == bare.kernel().awake().of);
  CHECK(play() == first);
}

}  // namespace
}  // namespace ressort::modes_asleep_test
