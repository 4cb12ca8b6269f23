// How fast each scheme nears what it stands for as the time step is halved: its order.
#include "core/kernels/direct/fourth_form.h"
#include "tests/support/passive.h"
#include "tests/support/poles.h"

namespace ressort {
namespace {

using namespace support;

// Of the errors at a step and at half of it.
double order_of(double coarse, double fine) {
  return std::log2(coarse / fine);
}

struct PoleErrors {
  double pitch = 0.0;  // the worst, as a share
  double decay = 0.0;
};

// Of a string, at so many times the rate.
PoleErrors errors_at(int times, const std::string& z, bool is_fourth) {
  Program program =
      make_program(network_of(scenes::string("s", 6, "0.05", z)), 44100.0 * times, true);
  if (is_fourth) {
    program.form = *fourth_form(program);
  }
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

// Where a mass is that a smooth push of 80 samples throws at `link`, 160 samples after it began.
double place_at(int times, const std::string& link) {
  const Network network =
      network_of("@g ground 0.\n@in1 posInput 0.\n@in2 frcInput @m\n@m osc 1. 0.002 0. 0. 0.\n" +
                 link + "\n@out1 posOutput @m\n");
  Bare<double> bare(
      make_program(network, 44100.0 * times, true, schemes_of(network, Passivity::always).links));
  double place = 0.0;
  for (int n = 0; n < 160 * times; ++n) {
    const double at = static_cast<double>(n) / times / 80.0;
    const double push = at < 1.0 ? 1e-3 * std::pow(std::sin(std::numbers::pi * at), 4.0) : 0.0;
    place = bare.step({0.0, push / (times * times)})[0];
  }
  return place;
}

}  // namespace

TEST_CASE("pitch is of second or fourth order, decays of first or second", "[orders]") {
  const auto order = [](bool is_fourth, const std::string& z, double PoleErrors::*what) {
    return order_of(errors_at(4, z, is_fourth).*what, errors_at(8, z, is_fourth).*what);
  };
  CHECK(order(false, "0.00001", &PoleErrors::pitch) == Approx(2.0).margin(.1));
  CHECK(order(false, "0.001", &PoleErrors::decay) == Approx(1.0).margin(.1));
  CHECK(order(true, "0.", &PoleErrors::pitch) == Approx(4.0).margin(.1));
  CHECK(order(true, "0.001", &PoleErrors::decay) == Approx(2.0).margin(.1));
}

TEST_CASE("what is passive is of the order that is said", "[orders]") {
  struct Case {
    const char* link;
    double order;
    double margin;
  };
  // A kink in the force, as where a contact is touched, costs no order of a discrete gradient; a
  // damper that sets in at full speed there does.
  for (const Case& c : {Case{"@l nlSpring3 @m @g 0.001 0.5 0.", 2.0, .2},
                        Case{"@l nlSpring2 @m @g 0.001 0.1 0.", 2.0, .2},
                        Case{"@l powerContact @m @g 0.05 1.5 0. -0.02", 2.0, .3},
                        Case{"@l powerContact @m @g 0.05 2.3 0. -0.02", 2.0, .3},
                        Case{"@l contact @m @g 0.02 0. -0.02", 2.0, .5}}) {
    const double exact = place_at(256, c.link);
    const double coarse = place_at(8, c.link) - exact;
    const double fine = place_at(16, c.link) - exact;
    INFO(c.link << ": " << show(coarse) << " and " << show(fine) << " off " << show(exact));
    CHECK(order_of(std::fabs(coarse), std::fabs(fine)) == Approx(c.order).margin(c.margin));
  }
}

}  // namespace ressort
