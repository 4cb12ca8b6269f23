// tests: one small network for each feature of the FAUST export, by name.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/laws/law.h"
#include "tests/support/networks/scenes.h"

namespace ressort::scenes {

using namespace laws;

// Returns a mass between a wall and a link to position input 2; input 1 pushes it.
inline std::string law(const std::string& link) {
  return "@g ground 0.\n@m mass 1.5 0. 0.\n@r springDamper @g @m 0.05 0.002\n@in2 posInput 0.\n"
         "@l " +
         link + "\n@in1 frcInput @m\n@out1 posOutput @m\n@out2 frcOutput @m\n";
}

// Returns a macro with an input at one place and an output at another.
inline std::string played(const std::string& macro, const std::string& from,
                          const std::string& to) {
  return "@s " + macro + "\n@in1 frcInput [@s " + from + "]\n@out1 posOutput [@s " + to +
         "]\n@out2 frcOutput [@s " + to + "]\n";
}

// Returns a link by the first keyword of a law, with typical values. A bow's profile is parameter
// p.
inline std::string link_of(const LawFacts& law, const std::string& ends) {
  std::string text = std::string(law.words[0].word) + " " + ends;
  for (std::size_t i = 0; i < law.count; ++i) {
    const LawArgument& argument = law.arguments[i];
    switch (argument.role) {
      case Role::stiffness:
        text += " 0.03";
        break;
      case Role::bend:
        text += " 0.3";
        break;
      case Role::limit:
        text += " 0.1";
        break;
      case Role::damping:
        text += " 0.02";
        break;
      case Role::reach:
        text += " 0.05";
        break;
      case Role::shape:
        text +=
            argument.least < 0.0 ? std::string(" p") : " " + std::to_string(argument.least + 0.7);
        break;
    }
  }
  return text + std::string(law.words[0].tail);
}

inline std::string on_a_waveguide(const std::string& link) {
  return "@p param 0.\n@s waveguide 1.1 217. 4. 0.4 0.\n@in1 frcInput [@s 0.2]\n@in2 posInput "
         "0.\n@l " +
         link + "\n@out1 posOutput [@s 0.7]\n@out2 frcOutput @in2\n";
}

// Returns models with every law, between a mass and input 2 and between a waveguide and input 2.
inline std::vector<std::pair<std::string, std::string>> models_of_laws() {
  std::vector<std::pair<std::string, std::string>> all;
  for (const LawFacts& facts : law_table()) {
    const std::string name(facts.name);
    all.emplace_back("mass_" + name, "@p param 0.\n" + law(link_of(facts, "@m @in2")));
    all.emplace_back("waveguide_" + name, on_a_waveguide(link_of(facts, "[@s 0.4] @in2")));
  }
  return all;
}

inline const std::vector<std::pair<std::string, std::string>>& faust_models() {
  static const std::vector<std::pair<std::string, std::string>> all{
      {"spring", law("spring @m @in2 0.03 0.01")},
      {"undamped_spring", law("spring @m @in2 0.03")},
      {"damper", law("damper @m @in2 0.01")},
      {"quadratic_spring", law("nlSpring2 @m @in2 0.01 0.05 0.002")},
      {"cubic_spring", law("nlSpring3 @m @in2 0.01 0.05 0.002")},
      {"clipped_spring", law("nlSpringDamper @m @in2 0.01 0.5 0.1 0.002")},
      {"clipped_spring_flat", law("nlSpringDamper @m @in2 0.01 0. 0.1 0.002")},
      {"clipped_spring_stiff", law("nlSpringDamper @m @in2 0.2 0.5 0.1 0.002")},
      {"clipped_spring_softening", law("nlSpringDamper @m @in2 0.01 -0.5 0.1 0.002")},
      {"pluck", law("nlPluck @in2 @m 0.1 0.1")},
      {"damped_pluck", law("nlPluck @in2 @m 0.1 0.1 0.01")},
      {"bow", law("nlBow @in2 @m 0.2 0.02")},
      {"smooth_bow", law("nlBow @in2 @m 0.2 0.02 1")},
      {"turned_bow", "@p param 0.\n" + law("nlBow @in2 @m 0.2 0.02 [1 - p]")},
      {"sounding_bow", "@p audioParam @in1\n" + law("nlBow @in2 @m 0.2 0.02 p")},
      {"contact", law("contact @m @in2 0.1 0.01 0.05")},
      {"plain_contact", law("contact @m @in2 0.1 0.01")},
      {"clipped_contact", law("nlContact @m @in2 0.02 5. 0.1 0.01 0.05")},
      {"clipped_contact_flat", law("nlContact @m @in2 0.02 0. 0.1 0.01")},
      {"power_contact", law("powerContact @m @in2 0.1 1.5 0.05 0.05")},
      {"clipped_contact_stiff", law("nlContact @m @in2 0.2 0.5 0.1 0.01")},
      {"body",
       "@p param 0.4\n@b body 3. x y z\n@b1 mode @b 210. 0.8 1. -0.4 0.3\n"
       "@b2 mode @b [900*p] 0.2*p -0.5 0.7 0.2\n@b3 mode @b 21000. 0.1 0.2 0.3 0.4\n"
       "@b4 mode @b 5. 0.002 0.2 0.1 -0.4\n@m mass 1. 0. 0.\n@in1 frcInput [@b x]\n"
       "@in2 posInput 0.\n@l contact [@b y] @in2 0.1 0.01\n@r spring [@b p] @m 0.05 0.01\n"
       "@out1 posOutput [@b z]\n@out2 frcOutput [@b 0.3]\n"},
      // Waveguides: free, with open ends, held by springs, and with sliders.
      {"waveguide", played("waveguide 1.3 217. 4. 0.3 0.", "0.37", "0.23")},
      {"open_waveguide", played("openWaveguide 0.7 583. 0.2 1. 0.3", "0", "1")},
      {"held_waveguide",
       "@f param 331.\n@t param 2.\n@R param 1.2\n@b param 0.4\n@s waveguide R f t b 0.\n"
       "@m mass 3. 0. 0.\n@k spring [@s 0.93] @m 0.3 0.02\n@g ground 0.\n@l spring @g @m 0.02 "
       "0.01\n"
       "@in1 frcInput [@s 0.2]\n@in2 posInput 0.\n@h spring @in2 [@s 0.5] 0.05 0.3\n"
       "@out1 posOutput [@s 0.4]\n@out2 frcOutput @m\n@out3 frcOutput [@s 0.93]\n"},
      {"waveguides_on_a_box",
       "@s waveguide 1. 110. 5. 0.3 0.\n@o openWaveguide 0.5 97. 3. 0.6 0.\n"
       "@b body 40. bridge top\n@b1 mode @b 104. 0.4 1. 0.3\n@b2 mode @b 211. 0.3 0.8 -0.5\n"
       "@b3 mode @b 393. 0.2 -0.6 0.9\n@e string 6 2. 0.3 0.001 0. 0.\n@m mass 4. 0. 0.\n"
       "@g ground 0.\n@ks spring [@s 0.97] [@b bridge] 0.5 0.01\n"
       "@ko spring [@o 1] [@e 0.55] 5. 0.1\n@kso spring [@s 0.3] [@o 0.6] 0.02 0.002\n"
       "@kg spring @g [@o 0.2] 0.01\n@km spring [@s 0.5] @m 0.1\n@in1 frcInput [@s 0.21]\n"
       "@in2 frcInput [@b top]\n@p nlPluck @in3 @m 0.01 0.1\n@in3 posInput 0.\n"
       "@out1 posOutput [@b top]\n@out2 posOutput [@o 0]\n@out3 frcOutput [@b bridge]\n"
       "@out4 posOutput [@e 0.2]\n@out5 frcOutput @g\n@out6 posOutput @m\n"},
      // Links of every law that hold waveguides: at rest, under tension at the start, thrown, and
      // with ends that channels move.
      {"laws_on_waveguides",
       "@p param 0.\n@s1 waveguide 1.1 217. 4. 0.4 0.\n@s2 waveguide 0.9 163. 4. 0.4 0.\n"
       "@s3 openWaveguide 1.3 191. 1. 0.4 0.\n@in1 frcInput [@s1 0.2]\n@in2 posInput 0.\n"
       "@in3 posInput 0.\n@in4 frcInput [@s3 0.9]\n@l1 nlPluck @in2 [@s1 0.37] 0.1 0.1 0.01\n"
       "@l2 nlBow @in2 [@s1 0.61] 0.8 0.02\n@l3 nlBow @in3 [@s1 0.77] 0.8 0.02 1\n"
       "@l4 nlBow @in3 [@s1 0.91] 0.8 0.02 [1 - p]\n@l5 contact @in2 [@s2 0.2] 0.1 0.01 0.05\n"
       "@l6 nlContact @in2 [@s2 0.4] 0.02 5. 0.1 0.01 0.05\n"
       "@l7 powerContact [@s2 0.7] @in3 0.1 2.3 0.05 0.05\n@l8 detent @in3 [@s3 0.1] 0.1 0.01\n"
       "@l9 nlSpring2 @in2 [@s3 0.3] 0.01 0.5 0.002\n@l10 nlSpring3 [@s3 0.5] @in3 0.01 0.5 0.002\n"
       "@l11 nlSpringDamper @in2 [@s3 0.7] 0.01 0.5 0.1 0.002\n@out1 posOutput [@s1 0.5]\n"
       "@out2 posOutput [@s2 0.5]\n@out3 posOutput [@s3 0.6]\n@out4 frcOutput @in2\n"
       "@out5 frcOutput [@s3 0.5]\n"},
      {"hammer_on_a_waveguide",
       "@s waveguide 1.1 217. 4. 0.4 0.\n@h mass 3. -0.02 30.\n@b body 5. x\n"
       "@b1 mode @b 210. 0.8 1.\n@b2 mode @b 900. 0.2 -0.5\n"
       "@felt powerContact @h [@s 0.12] 0.3 2.5 0.1\n@hand mass 2. 0.01 -10.\n"
       "@beat contact [@s 0.3] @hand 0.05 0.01\n@stop contact @hand [@b x] 0.1 0.02\n"
       "@in1 frcInput [@s 0.7]\n@in2 frcInput @hand\n@out1 posOutput [@s 0.4]\n"
       "@out2 posOutput @h\n@out3 frcOutput @h\n@out4 posOutput [@b x]\n@out5 posOutput @hand\n"},
      {"stretched_on_waveguides",
       "@s waveguide 1.1 217. 4. 0.4 0.\n@g ground 0.01\n@m mass 3. 0. -20.\n@n mass 2. 0.02 0.\n"
       "@a spring @g [@s 0.2] 0.1 0.01\n@b spring @m [@s 0.4] 0.1 0.01\n"
       "@c contact @n [@s 0.6] 0.1 0.01\n@in1 frcInput [@s 0.7]\n@out1 posOutput [@s 0.4]\n"
       "@out2 posOutput @m\n@out3 posOutput @n\n"},
      {"driven_ends_of_waveguides",
       "@q audioParam @in2\n@w audioParam @in4\n@s waveguide [1.2+0.3*w] 160. 3. 0.4 0.\n"
       "@t openWaveguide 0.8 217. 3. 0.4 0.\n@b body 5. x y z\n@b1 mode @b 210. 0.8 1. -0.4 0.3\n"
       "@b2 mode @b 900 0.2 -0.5 0.7 0.2\n@e string 6 2. 0.3 0.001 0. 0.2\n"
       "@m mass [1.5+w*w] [10*w] 0.3 50.\n@o osc [1.2+0.3*w*w] [0.1+0.05*w*w] [0.01+0.004*w*w] 0. "
       "0.1 40.\n"
       "@k1 spring [@s 0.4] [@b q] 0.2 0.01\n@k2 nlSpring3 [@t 0.3] [@e q] 0.1 0.3 0.01\n"
       "@k3 nlBow [@s 0.8] @m 0.3 0.02\n@k4 contact [@t 0.7] @o 0.1 0.01 -0.5\n"
       "@e2 string 5 2. 0.3 0.001 0. 0.1\n@k5 spring [@t 0.9] [@e2 0.05] 0.01 0.001\n"
       "@in1 frcInput [@s 0.7]\n@in2 posInput 0.\n@in3 frcInput @m\n@in5 frcInput @o\n"
       "@out1 posOutput [@s 0.4]\n@out2 posOutput [@b y]\n@out3 frcOutput @m\n"
       "@out4 posOutput [@e 0.5]\n@out5 posOutput @o\n"},
      // Gravity and initial velocities, in both dialects.
      {"older_start",
       "@g ground 0.3\n@m massG 1.2 0.002 1. 0.9\n@o osc 2. 0.1 0.01 0.5 0.45\n"
       "@r spring @g @m 0.05 0.01\n@q spring @m @o 0.02 0.01\n@in1 posInput -0.4\n"
       "@d damper @in1 @o 0.01\n@out1 posOutput @m\n@out2 posOutput @o\n@out3 frcOutput @g\n"},
      {"newer_start",
       "@g ground [0 0 0.3]\n@m mass 1.2 40. [0 0 1.] -200.\n@o osc 2. 0.1 0.01 30. [0 0 0.5] 90.\n"
       "@h osc 1. 0.2 0.01 [0 0 0.] 50.\n@still osc 1. 0.2 0.01 [0 0 0.2] 0.\n"
       "@r spring @g @m 0.05 0.01\n@q spring @m @o 0.02 0.01\n@in1 posInput [0 0 -0.4]\n"
       "@d damper @in1 @o 0.01\n@out1 posOutput @m\n@out2 posOutput @o\n@out3 frcOutput @g\n"
       "@out4 posOutput @h\n@out5 posOutput @still\n"},
      {"falling", "@m mass 2. 20. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n"},
      // Macros.
      {"string", played("string 10 1. 0.5 0.0003 0. 0.", "0.7", "0.2")},
      {"airy_string", played("string 20 1. 0.1 0.001 0.00005 0. 0.", "0.1", "0.9")},
      {"raised_string", played("string 10 1.1 0.3 0.003 0.0001 0.4 30.", "0.7", "0.25")},
      {"chain", played("chain 8 1. 0.2 0.002 0.001 0. 0.", "0", "1")},
      {"stiff_string", played("stiffString 12 1. 0.4 0.2 0.01 0. 0.", "0.3", "0.95")},
      {"mesh", played("mesh 4 3 1. 0.2 0.001 0.001 0. 0.", "0.3 0.5", "0.75 0.6")},
      {"closed_mesh", played("closedMesh 5 4 1. 0.2 0.0001 0. 0.", "0.3 0.5", "0.75 0.5")},
      {"corner_mesh", played("cornerMesh 4 5 1. 0.2 0.001 0.0002 0.1 0.", "0.3 0.5", "0.95 0.1")},
      {"older_macro",
       "@s string 8 1. 0.3 0.01 0.2\n@in1 posInput 1.\n@c contact @s @in1 0.1 0.01 0.2 0.4\n"
       "@out1 posOutput @s 0.3\n@out2 frcOutput @s 0.5\n"},
      // Places at coordinates from parameters, expressions and channels.
      {"places",
       "@p param 0.3\n@q audioParam @in2\n@s string 9 1. 0.3 0.003 0. 0.\n"
       "@me closedMesh 5 5 1. 0.2 0.002 0. 0.\n@in1 frcInput [@s p+0.1]\n@in3 posInput 0.\n"
       "@pick nlPluck @in3 [@s q] 0.1 0.1\n@bridge spring [@s 1.1*p] [@me q p] 0.02 0.001\n"
       "@tie spring [@s 0.4] [@s 0.65] 0.01 0.001\n@out1 posOutput [@s q]\n"
       "@out2 posOutput [@me 0.5+0.4*q q]\n@out3 frcOutput [@me q 0.5]\n@out4 frcOutput @in3\n"},
      // A channel that changes everything.
      {"driven",
       "@w audioParam @in2\n@T param 0.1\n@g ground 0.2\n@m mass [1.5+w] [10*w] 0.3 50.\n"
       "@o osc [1.2+0.3*w] [0.1+0.05*w] [0.01+0.004*w] [5*w] 0.1 40.\n"
       "@o2 osc 1. [0.1+0.02*w] 0.01 0. 0.\n@r springDamper @g @m [T+0.05*w] [0.01+0.003*w]\n"
       "@l nlSpring3 @m @o [0.05+0.02*w] [0.1*w] 0.001\n@q spring @o @o2 0.03\n"
       "@in1 frcInput @m\n@in3 frcInput @o\n@in2 posInput 0.\n@t spring @in2 @o2 0.01 [0.01*w*w]\n"
       "@out1 posOutput @m\n@out2 posOutput @o\n@out3 posOutput @o2\n@out4 frcOutput @o\n"},
      // All functions of expressions; names that are reserved in FAUST.
      {"expressions",
       "@process param 0.1\n@with param -0.02\n@in param 2\n@rest param 1e-5\n"
       "@import ground 0.\n@mem mass [max(1,in-0.5)] 0. 0.\n@m-x mass [abs(with)*50+pow(in,0.5)] "
       "0. 0.\n"
       "@select2 springDamper @import @mem [process*sqrt(in/4)] [exp(with)*0.001]\n"
       "@r springDamper @mem @m-x [-with*(process+(in-1)-0.9)] [clamp(rest*100,0.0005,0.01)]\n"
       "@r springDamper @mem @m-x [0.01-(process-0.1)-(-0.01)] [min(rest,1)/(2*in/4)]\n"
       "@x springDamper @import @m-x [0.05*sin(in)+0.001*cos(in)*in/in*2] [0.001]\n"
       "@in1 frcInput @mem\n@out1 posOutput @m-x\n@out2 posOutput @mem\n"},
      // Channels with gaps, parallel links, lines in any order, a mass without
      // links, a link from a mass to itself, outputs of fixed points.
      {"wiring",
       "@out7 posOutput @b\n@in1 frcInput @a\n@in5 frcInput @b\n@l1 spring @a @b 0.05 0.001\n"
       "@l2 spring @b @a 0.03 0.002\n@l3 spring @g @b 0.02 0.001\n@lone mass 3. 0. 0.\n"
       "@in2 frcInput @lone\n@a mass 1. 0. 0.\n@b mass 2. 0. 0.\n@g ground 0.\n@in3 posInput 0.1\n"
       "@l4 spring @in3 @a 0.02 0.001\n@l5 spring @a @a 0.1 0.1\n@in4 frcInput @a\n"
       "@in7 frcInput @g\n@out1 frcOutput @g\n@out2 posOutput @in3\n@out3 frcOutput @in3\n"
       "@out5 posOutput @lone\n@out6 frcOutput @a\n@out8 posOutput @g\n"},
      {"nothing_moves",
       "@in1 posInput 0.2\n@g ground 0.1\n@r spring @g @in1 0.1 0.2\n@out1 frcOutput @in1\n"
       "@out2 posOutput @in1\n"},
      {"long_chain", string("s", 200, "0.3", "0.002") +
                         "@in1 frcInput @s_m20\n@in2 posInput 0.\n@p nlPluck @in2 @s_m30 0.1 0.1\n"
                         "@out1 posOutput @s_m40\n@out2 posOutput @s_m180\n"},
      {"triangle", iplay_the_triangle()},
      {"poly_triangle", poly_triangle()},
      {"resonator", resonator()},
      {"physical_lfo", physical_lfo()},
  };
  return all;
}

}  // namespace ressort::scenes
