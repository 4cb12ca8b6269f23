// The order of convergence of each scheme as the time step is halved.
#include "tests/support/passive.h"
#include "tests/support/poles.h"

namespace ressort::orders_test {
namespace {

using namespace support;

// Order from the errors at a step and at half of it.
double order_of(double coarse, double fine) {
  return std::log2(coarse / fine);
}

struct PoleErrors {
  double pitch = 0.0;  // Worst relative errors.
  double decay = 0.0;
};

// Errors of a string at `times` the rate.
PoleErrors errors_at(int times, const std::string& z) {
  const Program program =
      make_program(network_of(scenes::string("s", 6, "0.05", z)), 44100.0 * times, true);
  const std::vector<Pole> wanted = continuous_poles(matrices_of(program));
  const std::vector<Pole> found = poles_of(transition(program));
  REQUIRE(wanted.size() == found.size());
  PoleErrors errors;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    errors.pitch = std::max(errors.pitch, std::fabs(found[i].hertz / wanted[i].hertz - 1.0));
    errors.decay = std::max(errors.decay, std::fabs(found[i].t60_s / wanted[i].t60_s - 1.0));
  }
  return errors;
}

// Position of a mass that a smooth push of 80 samples throws at `link`, 160 samples after it began.
double place_at(int times, const std::string& link, Passivity passive = Passivity::always) {
  const Network network =
      network_of("@g ground 0.\n@in1 posInput 0.\n@in2 frcInput @m\n@m osc 1. 0.002 0. 0. 0.\n" +
                 link + "\n@out1 posOutput @m\n");
  Bare<double> bare(
      make_program(network, 44100.0 * times, true, schemes_of(network, passive).links));
  double place = 0.0;
  for (int n = 0; n < 160 * times; ++n) {
    const double at = static_cast<double>(n) / times / 80.0;
    const double push = at < 1.0 ? 1e-3 * std::pow(std::sin(std::numbers::pi * at), 4.0) : 0.0;
    place = bare.step({0.0, push / (times * times)})[0];
  }
  return place;
}

}  // namespace

TEST_CASE("the published scheme has a pitch error of second order and a decay error of first",
          "[orders]") {
  const auto order = [](const std::string& z, double PoleErrors::*what) {
    return order_of(errors_at(4, z).*what, errors_at(8, z).*what);
  };
  CHECK(order("0.00001", &PoleErrors::pitch) == Approx(2.0).margin(.1));
  CHECK(order("0.001", &PoleErrors::decay) == Approx(1.0).margin(.1));
}

TEST_CASE("springs, contacts and friction converge with the stated order", "[orders]") {
  struct Case {
    const char* link;
    double passive;
    double published;
    double margin = .1;
  };
  // A kink in the force, as at a contact's edge, costs a discrete gradient no order. The published
  // contact converges irregularly, because it sees the kink a fraction of a sample late. Published
  // damping and friction are of first order, as are damped nonlinear springs.
  for (const Case& c :
       {Case{"nlSpring3 @m @g 0.001 0.5 0.", 2.0, 2.0},
        Case{"nlSpring2 @m @g 0.001 0.1 0.", 2.0, 2.0},
        Case{"nlSpringDamper @m @g 0.001 0.1 0.003 0.", 1.0, 1.0},
        Case{"contact @m @g 0.02 0. -0.02", 2.0, 2.0, .4},
        Case{"nlContact @m @g 0.01 10. 0.05 0. -0.02", 2.0, 2.0},
        Case{"powerContact @m @g 0.05 1.5 0. -0.02", 2.0, 2.0},
        Case{"powerContact @m @g 0.05 2.3 0. -0.02", 2.0, 2.0},
        Case{"powerContact @m @g 0.05 1.5 0.05 -0.02", 2.0, 1.25},
        Case{"contact @m @g 0.02 0.01 -0.02", 2.0, 1.0, .3},
        Case{"nlPluck @m @g 0.01 0.05", 2.0, 2.0, .4}, Case{"nlBow @m @g 0.01 0.01", 2.0, 1.0, .2},
        Case{"nlBow @m @g 0.01 0.01 1", 2.0, 1.0}}) {
    for (const Passivity passive : {Passivity::always, Passivity::never}) {
      const std::string link = std::string("@l ") + c.link;
      const double exact = place_at(512, link, passive);
      const double coarse = place_at(8, link, passive) - exact;
      const double fine = place_at(32, link, passive) - exact;
      INFO(link << (passive == Passivity::always ? "" : " as published") << ": " << show(coarse)
                << " and " << show(fine) << " off " << show(exact));
      CHECK(order_of(std::fabs(coarse), std::fabs(fine)) / 2.0 ==
            Approx(passive == Passivity::always ? c.passive : c.published).margin(c.margin));
    }
  }
}

}  // namespace ressort::orders_test
