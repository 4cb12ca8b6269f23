// tests: shared scenes as .mdl texts. The nine instruments of Leonard, Villeneuve and Michon are
// built in full size from their description: labels, numbers, inputs, outputs.
#pragma once

#include <string>
#include <vector>

namespace ressort::scenes {

std::string at(const std::string& prefix, int i);
std::string at(const std::string& prefix, int i, int j);

// A ground s0 on one corner of three masses m_m0, m_m1, m_m2. Two springs share a label, as
// published.
std::string triangle(const std::string& stiffness, const std::string& damping);

// `count` masses p_m0... between the grounds p_s0 and p_s1, and the springs p_r0...
std::string string(const std::string& p, int count, const std::string& stiffness,
                   const std::string& damping);

// Rows j = 0..n-1 of n-j masses p_m{j}_{i}; the first corner is a ground.
std::string triangle_mesh(const std::string& p, int n, const std::string& stiffness,
                          const std::string& damping);

// length x height masses p_m{j}_{i}; two opposite corners are grounds.
std::string square_mesh(const std::string& p, int length, int height, const std::string& stiffness,
                        const std::string& damping);

// Pure damping while the finger at `input` is below a mass.
std::string touch(const std::string& label, const std::string& mass, int input);

std::string output(int number, const std::string& mass);

// --- the nine instruments ---------------------------------------------------------------------

std::string iplay_the_triangle();

std::string poly_triangle(const std::string& damping = "0.001");

std::string plucked_harmonics();

std::string bowed_string(const std::string& profile = "");

std::string large_triangle_mesh();

std::string resonator();

std::string physical_lfo();

std::string mesh_20x30();

std::string string_1000();

struct Example {
  std::string name;
  std::string text;
  bool is_linear = true;
  int moving = 0;  // Moving masses according to the description.
  int links = 0;
  double reach = 1.0;  // Amplitude of its first input: a position, a speed for bows, or a force.
};

std::vector<Example> nine_instruments();

}  // namespace ressort::scenes
