#include "tests/support/networks/scenes.h"

namespace ressort::scenes {

std::string at(const std::string& prefix, int i) {
  return "@" + prefix + std::to_string(i);
}

std::string at(const std::string& prefix, int i, int j) {
  return at(prefix, i) + "_" + std::to_string(j);
}

std::string triangle(const std::string& stiffness, const std::string& damping) {
  return "@m_K param " + stiffness + "\n@m_Z param " + damping +
         "\n"
         "@m_s0 ground 0.\n"
         "@m_m0 mass 1. 0. 0.\n"
         "@m_m1 mass 1. 0. 0.\n"
         "@m_m2 mass 1. 0. 0.\n"
         "@m_r0 springDamper @m_s0 @m_m0 0.05 0.01\n"
         "@m_r1 springDamper @m_m0 @m_m1 m_K m_Z\n"
         "@m_r2 springDamper @m_m1 @m_m2 m_K m_Z\n"
         "@m_r2 springDamper @m_m2 @m_m0 m_K m_Z\n";
}

std::string string(const std::string& p, int count, const std::string& stiffness,
                   const std::string& damping) {
  std::string text = "@" + p + "_M param 1.\n@" + p + "_K param " + stiffness + "\n@" + p +
                     "_Z param " + damping + "\n";
  text += "@" + p + "_s0 ground 0.\n";
  for (int i = 0; i < count; ++i) {
    text += at(p + "_m", i) + " mass " + p + "_M 0. 0.\n";
  }
  text += "@" + p + "_s1 ground 0.\n";
  for (int i = 0; i <= count; ++i) {
    text += at(p + "_r", i) + " springDamper " + (i == 0 ? "@" + p + "_s0" : at(p + "_m", i - 1)) +
            " " + (i == count ? "@" + p + "_s1" : at(p + "_m", i)) + " " + p + "_K " + p + "_Z\n";
  }
  return text;
}

std::string triangle_mesh(const std::string& p, int n, const std::string& stiffness,
                          const std::string& damping) {
  std::string text;
  text += "@" + p + "_K param " + stiffness + "\n@" + p + "_Z param " + damping + "\n";
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n - j; ++i) {
      text += at(p + "_m", j, i) + (i + j == 0 ? " ground 0.\n" : " mass 1. 0. 0.\n");
    }
  }
  int links = 0;
  const auto link = [&](int j, int i, int to_j, int to_i) {
    text += at(p + "_r", links++) + " springDamper " + at(p + "_m", j, i) + " " +
            at(p + "_m", to_j, to_i) + " " + p + "_K " + p + "_Z\n";
  };
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i + 1 < n - j; ++i) {
      link(j, i, j, i + 1);
    }
  }
  for (int j = 0; j + 1 < n; ++j) {
    for (int i = 0; i < n - j - 1; ++i) {
      link(j, i, j + 1, i);
      link(j, i + 1, j + 1, i);
    }
  }
  return text;
}

std::string square_mesh(const std::string& p, int length, int height, const std::string& stiffness,
                        const std::string& damping) {
  std::string text;
  text += "@" + p + "_K param " + stiffness + "\n@" + p + "_Z param " + damping + "\n";
  for (int j = 0; j < length; ++j) {
    for (int i = 0; i < height; ++i) {
      const bool is_corner = i + j == 0 || (j == length - 1 && i == height - 1);
      text += at(p + "_m", j, i) + (is_corner ? " ground 0.\n" : " mass 1. 0. 0.\n");
    }
  }
  int links = 0;
  const auto link = [&](int j, int i, int to_j, int to_i) {
    text += at(p + "_r", links++) + " springDamper " + at(p + "_m", j, i) + " " +
            at(p + "_m", to_j, to_i) + " " + p + "_K " + p + "_Z\n";
  };
  for (int j = 0; j < length; ++j) {
    for (int i = 0; i + 1 < height; ++i) {
      link(j, i, j, i + 1);
    }
  }
  for (int j = 0; j + 1 < length; ++j) {
    for (int i = 0; i < height; ++i) {
      link(j, i, j + 1, i);
    }
  }
  return text;
}

std::string touch(const std::string& label, const std::string& mass, int input) {
  return "@" + label + " contact @" + mass + " " + at("in", input) + " 0. 0.01 0.\n";
}

std::string output(int number, const std::string& mass) {
  return at("out", number) + " posOutput @" + mass + "\n";
}

std::string iplay_the_triangle() {
  return "@in1 posInput 0.\n" + triangle("0.1", "0.001") + "@det nlPluck @in1 @m_m1 0.05 0.01\n" +
         output(1, "m_m2");
}

std::string poly_triangle(const std::string& damping) {
  return triangle("0.1", damping) + "@in1 frcInput @m_m1\n" + output(1, "m_m2");
}

std::string plucked_harmonics() {
  std::string text = string("low", 150, "0.5", "0.01");
  text += "@in1 posInput 0.\n@in2 posInput 0.\n@in3 posInput 0.\n@in4 posInput 0.\n";
  text += "@pick nlPluck @in1 @low_m140 0.1 0.05\n";
  text += touch("t1", "low_m37", 2) + touch("t2", "low_m38", 2) + touch("t3", "low_m50", 3) +
          touch("t4", "low_m51", 3) + touch("t5", "low_m75", 4) + touch("t6", "low_m76", 4);
  return text + output(1, "low_m20") + output(2, "low_m10");
}

std::string bowed_string(const std::string& profile) {
  return string("low", 150, "0.3", "0.001") +
         "@nlZ param 0.08\n@in1 posInput 1.\n@bow nlBow @in1 @low_m133 nlZ 0.00005 " + profile +
         "\n" + output(1, "low_m30") + output(2, "low_m40");
}

std::string large_triangle_mesh() {
  std::string text = triangle_mesh("tri", 25, "0.1", "0.0005");
  text += "@in1 posInput 0.\n@in2 posInput 0.\n@in3 posInput 0.\n@in4 posInput 0.\n";
  text += "@pick nlPluck @in1 @tri_m22_1 0.1 0.03\n";
  text += touch("t1", "tri_m8_1", 2) + touch("t2", "tri_m8_2", 2) + touch("t3", "tri_m17_3", 3) +
          touch("t4", "tri_m17_4", 3) + touch("t5", "tri_m13_9", 4) + touch("t6", "tri_m13_10", 4);
  return text + output(1, "tri_m3_11") + output(2, "tri_m1_5");
}

std::string resonator() {
  std::string text = "@K param 0.3\n@Z param 0.01\n@in1 posInput 0.\n";
  for (int i = 0; i < 30; ++i) {
    text += at("str_m", i) + " mass 1. 0. 0.\n";
  }
  text += "@str_s1 ground 0.\n";
  for (int i = 0; i <= 30; ++i) {
    text += at("str_r", i) + " springDamper " + (i == 0 ? "@in1" : at("str_m", i - 1)) + " " +
            (i == 30 ? "@str_s1" : at("str_m", i)) + " K Z\n";
  }
  return text + output(1, "str_m29");
}

std::string physical_lfo() {
  return string("str", 10, "0.000001", "0.0001") + "@in1 frcInput @str_m0\n" + output(1, "str_m1");
}

std::string mesh_20x30() {
  return square_mesh("mesh", 20, 30, "0.1", "0.01") + "@in1 frcInput @mesh_m2_6\n" +
         output(1, "mesh_m19_3") + output(2, "mesh_m3_20");
}

std::string string_1000() {
  return string("str", 1000, "0.1", "0.01") +
         "@in1 posInput 0.\n@pick nlPluck @in1 @str_m140 0.1 0.05\n" + output(1, "str_m200") +
         output(2, "str_m100");
}

std::vector<Example> nine_instruments() {
  return {
      {"IPlayTheTriangle", iplay_the_triangle(), false, 3, 4 + 1, 0.02},
      {"PolyTriangle", poly_triangle(), true, 3, 4, 0.1},
      {"PluckedHarmonics", plucked_harmonics(), false, 150, 151 + 7, 0.1},
      {"BowedString", bowed_string(), false, 150, 151 + 1, 5e-5},
      {"LargeTriangleMesh", large_triangle_mesh(), false, 324, 900 + 7, 0.06},
      {"Resonator", resonator(), true, 30, 31, 1.0},
      {"PhysicalLFO", physical_lfo(), true, 10, 11, 0.1},
      {"20x30mesh", mesh_20x30(), true, 598, 1150, 0.1},
      {"1000massString", string_1000(), false, 1000, 1001 + 1, 0.1},
  };
}

}  // namespace ressort::scenes
