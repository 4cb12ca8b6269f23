// The text of exported models. export_test.cpp compiles it and compares the sound.
#include "core/model/faust/faust.h"

#include <algorithm>

#include "core/laws/law.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/system/faust_models.h"

namespace ressort::faust_test {

namespace {

std::string exported(const std::string& model, bool rescale = true) {
  const Network network = support::network_of(model);
  std::vector<ParameterSetting> sliders;
  for (const Parameter& parameter : network.parameters) {
    sliders.push_back(
        {parameter.name, parameter.value, 0.0, 4.0 * parameter.value, parameter.location});
  }
  auto text = faust_text(network, {.name = "one", .sliders = sliders, .rescale = rescale});
  REQUIRE(text);
  return *std::move(text);
}

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  INFO(part);
  CHECK(text.find(part) != std::string::npos);
  return true;
}

// Returns the exported stiffness of a link with this formula.
std::string stiffness(const std::string& formula) {
  const std::string text = exported(
      "@K param 0.1\n@L param 0.2\n@a mass 1. 0. 0.\n@b ground 0.\n"
      "@r spring @a @b [" +
      formula + "] 0.\n@out1 posOutput @a\n");
  const std::size_t start = text.find("f_r = spring(") + 13;
  return text.substr(start, text.find("*r*r, 0.0*r, x_a") - start);
}

const char* const swing =
    "@K param 0.1\n@g ground 0.5\n@m mass 1. 0. 0.\n@n osc 2. 0.2 K 0. 0.\n"
    "@r spring @g @m K 0.01\n@in1 frcInput @m\n@in3 frcInput @n\n@out2 posOutput @n\n"
    "@out3 frcOutput @m\n";

}  // namespace

TEST_CASE("an export has one line for each mass and link", "[faust]") {
  const std::string text = exported(swing);
  has(text,
      "// one, a network of masses and springs: 2 that move, 1 links.\n"
      "// input 1: force on m\n// input 2: not used\n// input 3: force on n\n"
      "// output 1: silent\n// output 2: position of n\n// output 3: force on m\n");
  has(text, "declare name \"one\";\n");
  has(text, "p_K = hslider(\"K\", 0.1, 0.0, 0.4, 0.0001);\n");
  has(text,
      "model(n_m, n_n, in1, in2, in3) =\n"
      "    to_m, to_n, 0.0, x_n, F_m/push(1.0) + in1\nwith {\n");
  has(text, "  x_g = 0.5;  v_g = 0.0;  F_g = 0.0 - f_r;\n");
  has(text, "  v_m = n_m + push(in1);  x_m = travel(0.0, v_m);  F_m = f_r;  to_m = v_m + F_m;\n");
  has(text,
      "  v_n = n_n + push(in3)/2.0;  x_n = travel(0.0, v_n);  F_n = 0.0;"
      "  to_n = v_n + (F_n - spring(0.2*r*r, p_K*r, x_n, v_n))/2.0;\n");
  has(text, "  f_r = spring(p_K*r*r, 0.01*r, x_g - x_m, v_g - v_m);\n};\n");
  has(text, "process = model ~ par(i, 2, _) : par(i, 2, !), par(i, 3, _);\n");
}

TEST_CASE("exported coefficients follow the sample rate unless rescaling is off", "[faust]") {
  has(exported(swing), "\nr = 44100.0/fconstant(int fSamplingFreq, <math.h>);");
  has(exported(swing, false), "\nr = 1.0;");
}

TEST_CASE("an export defines only the laws that it uses", "[faust]") {
  const std::string text = exported(swing);
  CHECK(text.find("pluck") == std::string::npos);
  CHECK(text.find("hat(") == std::string::npos);
  has(exported(
          "@a mass 1. 0. 0.\n@in1 posInput 0.\n@p nlPluck @in1 @a 0.1 0.2\n@out1 posOutput @a\n"),
      "f_p = pluck(0.1*r*r, 0.2, 0.0, x_in1 - x_a, v_in1 - v_a);");
}

TEST_CASE("an export defines the laws that a law calls", "[faust]") {
  const std::string ends = "@a mass 1. 0. 0.\n@g ground 0.\n@out1 posOutput @a\n@l ";
  for (const char* const law :
       {"nlSpring2 @g @a 0.1 0.2 0.", "nlSpring3 @g @a 0.1 0.2 0.",
        "nlSpringDamper @g @a 0.1 0.2 0.3 0.", "contact @g @a 0.1 0.2 0."}) {
    has(exported(ends + law + "\n"), "\nspring(k, z, d, v) =");
  }
  CHECK(exported(ends + "nlBow @g @a 0.1 0.2\n").find("spring(") == std::string::npos);
  const std::string turned = exported("@p param 0.\n" + ends + "nlBow @g @a 0.1 0.2 p\n");
  has(turned, "\nbow(z, s, d, v) =");
  has(turned, "\nsmooth_bow(z, s, d, v) =");
  has(turned, "f_l = either_bow(0.1*r, 0.2*r, p_p, ");
}

TEST_CASE("a link of every law that holds a waveguide brings its passive form", "[faust]") {
  for (const LawFacts& law : law_table()) {
    const std::string name(law.name);
    const std::string text =
        exported(scenes::on_a_waveguide(scenes::link_of(law, "[@s 0.4] @in2")));
    has(text, "\nsteady_" + name + "(");
    has(text, "\nalone_" + name + "(");
  }
}

TEST_CASE("a mass starts with the position and velocity of the model", "[faust]") {
  const std::string text = exported(
      "@a mass 1. 0.5 0.25\n@b osc 2. 0.1 0.01 -1. -1.\n@in1 posInput 2.\n"
      "@r spring @a @in1 0.1\n@out1 posOutput @a\n");
  has(text, "v_a = n_a + first(0.25*r);  x_a = travel(0.5, v_a);");
  has(text,
      "v_b = n_b + first(0.0 - spring(0.1*r*r, 0.01*r, (-1.0), 0.0)/2.0);  x_b = travel((-1.0), "
      "v_b);");
  has(text, "x_in1 = in1;  v_in1 = x_in1 - was(2.0, x_in1);");
}

TEST_CASE("gravity is scaled as the dialect defines it", "[faust]") {
  has(exported("@a massG 2. 0.1 0. 0.\n@out1 posOutput @a\n"), "v_a = n_a - push(0.1)/2.0;");
  has(exported("@a mass 2. 0.1 0. 0.\n@out1 posOutput @a\n"), "push(0.1)/44100.0/2.0");
}

TEST_CASE("an expression keeps its order of operations", "[faust]") {
  CHECK(stiffness("K") == "p_K");
  CHECK(stiffness("(K+L)*2") == "(p_K + p_L)*2.0");
  CHECK(stiffness("K+L*2") == "(p_K + p_L*2.0)");
  CHECK(stiffness("K-(L-1)") == "(p_K - (p_L - 1.0))");
  CHECK(stiffness("K-L-1") == "(p_K - p_L - 1.0)");
  CHECK(stiffness("K/(L*2)") == "p_K/(p_L*2.0)");
  CHECK(stiffness("K*(L/2)") == "p_K*(p_L/2.0)");
  CHECK(stiffness("-K*L") == "(0.0 - p_K)*p_L");
  CHECK(stiffness("-0.5*K") == "(-0.5)*p_K");
  CHECK(stiffness("1e-5+pow(K,2)") == "(0.00001 + pow(p_K, 2.0))");
  CHECK(stiffness("clamp(K,0,sqrt(L))") == "min(max(p_K, 0.0), sqrt(p_L))");
}

TEST_CASE("a place on a macro is a weighted sum of its nodes", "[faust]") {
  const std::string text = exported(
      "@p param 0.3\n@s string 5 1. 0.1 0.01 0. 0.\n@in1 frcInput [@s 0.375]\n"
      "@out1 posOutput [@s p]\n");
  has(text, "x_s_at1 = 0.5*x_s_1 + 0.5*x_s_2;");
  has(text, "v_s_2 = n_s_2 + 0.5*push(in1);");
  has(text,
      "row_s_at2 = along(5.0, p_p);  x_s_at2 = hat(0.0, row_s_at2)*x_s_0 + "
      "hat(1.0, row_s_at2)*x_s_1");
}

TEST_CASE("labels become different FAUST identifiers", "[faust]") {
  const std::string text = exported(
      "@with param 0.1\n@m-1 mass 1. 0. 0.\n@m_1 mass 1. 0. 0.\n@process ground 0.\n"
      "@r spring @process @m-1 with 0.\n@r spring @m-1 @m_1 with 0.\n@out1 posOutput @m_1\n");
  has(text, "p_with = hslider(\"with\"");
  has(text, "v_m_1 = n_m_1;");
  has(text, "v_m_1_2 = n_m_1_2;");
  has(text, "f_r = spring(p_with*r*r, 0.0*r, x_process - x_m_1,");
  has(text, "f_r_2 = spring(p_with*r*r, 0.0*r, x_m_1 - x_m_1_2,");
}

TEST_CASE("a parameter without a range is a number, an audio parameter its channel", "[faust]") {
  const Network network = support::network_of(
      "@K param 0.1\n@w audioParam @in2\n@a osc 1. K w 0. 0.\n@out1 posOutput @a\n");
  const std::vector<ParameterSetting> sliders = {{"K", 0.1, 0.1, 0.1, {}},
                                                 {"w", 0.0, 0.0, 1.0, {}}};
  const auto text = faust_text(network, {.name = "\"\n", .sliders = sliders});
  REQUIRE(text);
  has(*text, "p_K = 0.1;\n");
  has(*text, "declare name \"__\";\n");
  has(*text, "x_a = swing(1.0, p_K*r*r, in2*r, 0.0, 0.0*r, n_a) : _, !;");
}

TEST_CASE("a model without outputs cannot be exported", "[faust]") {
  const auto text = faust_text(support::network_of("@a mass 1. 0. 0.\n"), {.name = "mute"});
  REQUIRE(!text);
  CHECK(text.error().message.find("has no output") != std::string::npos);
}

TEST_CASE("the size of an export counts the nodes and links of macros", "[faust]") {
  CHECK(faust_elements(support::network_of("@s string 5 1. 0.1 0.01 0. 0.\n")) == 5 + 4);
}

}  // namespace ressort::faust_test
