// Which strings are found, and that they move as they are written.
#include "core/compile/chains_form.h"
#include "tests/duel.h"

namespace ressort {
namespace {

using rig::Comparison;
using rig::DuelOptions;
using rig::network_of;
using rig::Random;
using rig::show;

Program program_of(const std::string& text) {
  return make_program(network_of(text), 44100.0, true);
}

// The same in the form of chains, of which there must be some.
Program formed(const std::string& text) {
  Program program = program_of(text);
  auto form = chains_form(program);
  REQUIRE(form.has_value());
  program.form = std::move(*form);
  return program;
}

std::vector<Isa> isas() {
  std::vector<Isa> all = {Isa::base};
  for (const Isa isa : {Isa::v3, Isa::v4}) {
    if (isa <= best_isa()) {
      all.push_back(isa);
    }
  }
  return all;
}

template <class T>
void check_duel(const Program& program, DuelOptions options, double most_relative,
                double least_snr_db) {
  for (const Isa isa : isas()) {
    options.isa = isa;
    for (const Comparison& output : rig::duel<T>(program, options)) {
      INFO("on " << isa_name(isa) << ", seed " << options.seed << ": " << show(output.relative())
                 << " of the peak, " << output.snr_db() << " dB");
      CHECK(output.peak > 0.0);
      CHECK(output.relative() <= most_relative);
      CHECK(output.snr_db() >= least_snr_db);
    }
  }
}

// In double and, where rounding is not blown up by a contact, in float.
void check_both(const Program& program, const DuelOptions& options, double most_relative = 1e-12) {
  check_duel<double>(program, options, most_relative, 200.0);
  check_duel<float>(program, options, 1e-4, 100.0);
}

// Lines in an order that is nobody's.
std::string shuffled(const std::string& text, std::uint64_t seed) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines.push_back(text.substr(at, end + 1 - at));
    at = end + 1;
  }
  Random random(seed);
  for (std::size_t i = lines.size(); i > 1; --i) {
    std::swap(lines[i - 1], lines[random.below(i)]);
  }
  std::string result;
  for (const std::string& line : lines) {
    result += line;
  }
  return result;
}

// A row of `count` masses p_m0..., without what holds it.
std::string row(const std::string& p, int count, const std::string& mass,
                const std::string& spring) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += scenes::at(p + "_m", i) + " " + mass + " 0. 0.\n";
    if (i > 0) {
      text += scenes::at(p + "_r", i) + " springDamper " + scenes::at(p + "_m", i - 1) + " " +
              scenes::at(p + "_m", i) + " " + spring + "\n";
    }
  }
  return text;
}

}  // namespace

TEST_CASE("strings are found in any order of their lines", "[chains]") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    const Program program = formed(shuffled(scenes::plucked_harmonics(), seed));
    const auto& form = std::get<Chains>(program.form);
    REQUIRE(form.chains.size() == 1);
    const Chain& chain = form.chains[0];
    CHECK(chain.count == 150);
    CHECK(chain.left >= program.moving);
    CHECK(chain.right >= program.moving);
    CHECK(chain.left != chain.right);
    CHECK(form.loose.empty());
    CHECK(form.links.size() == 7);
    // Every two neighbours hang together.
    std::vector<std::uint64_t> springs;
    for (const Ends& ends : program.ends) {
      springs.push_back(std::uint64_t{std::min(ends.a, ends.b)} << 32 | std::max(ends.a, ends.b));
    }
    for (std::uint32_t i = 0; i + 1 < chain.count; ++i) {
      const auto [low, high] = std::minmax(form.nodes[i], form.nodes[i + 1]);
      CHECK(std::count(springs.begin(), springs.end(), std::uint64_t{low} << 32 | high) == 1);
    }
  }
}

TEST_CASE("what is no string is left as it is", "[chains]") {
  CHECK(!chains_form(program_of(scenes::iplay_the_triangle())));
  CHECK(!chains_form(program_of(scenes::mesh_20x30())));
  CHECK(!chains_form(program_of(row("a", 7, "mass 1.", "0.1 0.01"))));
  CHECK(chains_form(program_of(row("a", 8, "mass 1.", "0.1 0.01"))));
  // A branch belongs to nobody, another mass or spring ends a string.
  const std::string star =
      row("a", 8, "mass 1.", "0.1 0.01") + row("b", 9, "mass 1.", "0.1 0.01") +
      row("c", 10, "mass 1.", "0.1 0.01") + "@o mass 1. 0. 0.\n" +
      "@s1 springDamper @o @a_m0 0.1 0.01\n" + "@s2 springDamper @o @b_m0 0.1 0.01\n" +
      "@s3 springDamper @c_m9 @o 0.1 0.01\n" + "@s4 springDamper @c_m0 @b_m8 0.1 0.02\n";
  const auto form = chains_form(program_of(star));
  REQUIRE(form);
  CHECK(form->chains.size() == 3);
  CHECK(form->loose.size() == 1);
  CHECK(form->links.size() == 4);
  // A ring is cut somewhere.
  const auto ring = chains_form(
      program_of(row("a", 12, "mass 1.", "0.1 0.01") + "@s springDamper @a_m11 @a_m0 0.1 0.01\n"));
  REQUIRE(ring);
  CHECK(ring->chains[0].count == 12);
  CHECK(ring->links.size() == 1);
}

TEST_CASE("the instruments' strings move as they are written", "[chains]") {
  for (const bool turns : {false, true}) {
    CAPTURE(turns);
    check_both(formed(scenes::resonator()), {.reach = 1.0, .turns = turns});
    check_both(formed(scenes::physical_lfo()), {.reach = 0.1, .turns = turns, .pitch = 1.3});
    // Nearly constant bowing: in float a bow slips a sample earlier or later.
    check_duel<double>(formed(scenes::bowed_string()),
                       {.frames = 8000, .reach = 2e-3, .turns = turns}, 1e-9, 180.0);
    check_duel<double>(formed(scenes::plucked_harmonics()),
                       {.frames = 22050, .reach = 0.03, .turns = turns}, 1e-9, 180.0);
    check_duel<double>(formed(scenes::string_1000()),
                       {.frames = 22050, .reach = 0.03, .turns = turns, .pitch = 0.7}, 1e-9, 180.0);
  }
}

TEST_CASE("strings of every length fold into every pack", "[chains]") {
  for (int count = 8; count <= 70; ++count) {
    CAPTURE(count);
    for (const int ends : {0, 1, 2, 3}) {
      CAPTURE(ends);
      std::string text = row("a", count, "mass 1.", "0.2 0.01");
      text += "@in1 frcInput @a_m3\n";
      text += "@in2 posInput 0.5\n@g ground 0.2\n";
      if (ends & 1) {
        text += "@e springDamper @g @a_m0 0.2 0.01\n";
      }
      if (ends & 2) {
        text += "@f springDamper @in2 " + scenes::at("a_m", count - 1) + " 0.2 0.01\n";
      }
      text += scenes::output(1, "a_m0") + scenes::output(2, scenes::at("a_m", count - 1).substr(1));
      check_duel<double>(formed(text), {.frames = 600, .reach = 0.1}, 1e-12, 200.0);
    }
  }
}

}  // namespace ressort
