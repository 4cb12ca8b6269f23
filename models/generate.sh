#!/bin/sh
# Writes the larger of the nine instruments, mass by mass and link by link, into this folder.
# Run it after changing a number here; the small ones (triangles) are written by hand.
set -eu
cd "$(dirname "$0")"

# string LABEL N FIRST LAST: N masses between two ends that are declared here or elsewhere.
string() {
  awk -v p="$1" -v n="$2" -v first="$3" -v last="$4" 'BEGIN {
    for (i = 0; i < n; i++) printf "@%s_m%d mass %s_M 0. 0.\n", p, i, p
    print ""
    for (i = 0; i <= n; i++) {
      a = i == 0 ? first : p "_m" (i - 1)
      b = i == n ? last : p "_m" i
      printf "@%s_r%d springDamper @%s @%s %s_K %s_Z\n", p, i, a, b, p, p
    }
  }'
}

{
  cat <<'END'
# A string of 150 masses that is plucked (in1) and touched at its quarter (in2), its third (in3)
# and its half (in4), where harmonics are. A touch only damps, while the finger is above the string.
@low_M param 1.
@low_K param 0.5
@low_Z param 0.01
@nlK param 0.1
@nlscale param 0.05

@low_s0 ground 0.
@low_s1 ground 0.
END
  string low 150 low_s0 low_s1
  cat <<'END'

@in1 posInput 0.
@in2 posInput 0.
@in3 posInput 0.
@in4 posInput 0.

@touch0 contact @low_m37 @in2 0. 0.01 0.
@touch1 contact @low_m38 @in2 0. 0.01 0.
@touch2 contact @low_m50 @in3 0. 0.01 0.
@touch3 contact @low_m51 @in3 0. 0.01 0.
@touch4 contact @low_m75 @in4 0. 0.01 0.
@touch5 contact @low_m76 @in4 0. 0.01 0.
@pick nlPluck @in1 @low_m140 nlK nlscale

@out1 posOutput @low_m20
@out2 posOutput @low_m10
END
} > PluckedHarmonics.mdl

{
  cat <<'END'
# A string of 150 masses, bowed near its end (in1 is the bow's position).
@low_M param 1.
@low_K param 0.3
@low_Z param 0.001
@nlZ param 0.08
@nlscale param 0.00005

@low_s0 ground 0.
@low_s1 ground 0.
END
  string low 150 low_s0 low_s1
  cat <<'END'

@in1 posInput 1.
@bow nlBow @in1 @low_m133 nlZ nlscale

@out1 posOutput @low_m30
@out2 posOutput @low_m40
END
} > BowedString.mdl

{
  cat <<'END'
# A chain of 30 masses between a position that the audio input moves (in1) and a ground.
@str_M param 1.
@str_K param 0.3
@str_Z param 0.01

@in1 posInput 0.
@str_s1 ground 0.
END
  string str 30 in1 str_s1
  cat <<'END'

@out1 posOutput @str_m29
END
} > Resonator.mdl

{
  cat <<'END'
# A string so soft that it swings a few times a second: a source of slow change. in1 strikes it.
@str_M param 1.
@str_K param 0.000001
@str_Z param 0.0001

@str_s0 ground 0.
@str_s1 ground 0.
END
  string str 10 str_s0 str_s1
  cat <<'END'

@in1 frcInput @str_m0
@out1 posOutput @str_m1
END
} > PhysicalLFO.mdl

{
  cat <<'END'
# A string of a thousand masses, plucked (in1).
@str_M param 1.
@str_K param 0.1
@str_Z param 0.01
@nlK param 0.1
@nlscale param 0.05

@str_s0 ground 0.
@str_s1 ground 0.
END
  string str 1000 str_s0 str_s1
  cat <<'END'

@in1 posInput 0.
@pick nlPluck @in1 @str_m140 nlK nlscale

@out1 posOutput @str_m200
@out2 posOutput @str_m100
END
} > 1000massString.mdl

{
  cat <<'END'
# A square mesh of 20 rows of 30 points, held at two opposite corners; in1 strikes it.
@mesh_M param 1.
@mesh_K param 0.1
@mesh_Z param 0.01

END
  awk -v rows=20 -v columns=30 'BEGIN {
    for (j = 0; j < rows; j++) for (i = 0; i < columns; i++) {
      held = (j == 0 && i == 0) || (j == rows - 1 && i == columns - 1)
      printf "@mesh_m%d_%d %s\n", j, i, held ? "ground 0." : "mass mesh_M 0. 0."
    }
    print ""
    for (j = 0; j < rows; j++) for (i = 0; i + 1 < columns; i++)
      printf "@mesh_r%d springDamper @mesh_m%d_%d @mesh_m%d_%d mesh_K mesh_Z\n", n++, j, i, j, i + 1
    for (j = 0; j + 1 < rows; j++) for (i = 0; i < columns; i++)
      printf "@mesh_r%d springDamper @mesh_m%d_%d @mesh_m%d_%d mesh_K mesh_Z\n", n++, j, i, j + 1, i
  }'
  cat <<'END'

@in1 frcInput @mesh_m2_6
@out1 posOutput @mesh_m19_3
@out2 posOutput @mesh_m3_20
END
} > 20x30mesh.mdl

{
  cat <<'END'
# A triangular mesh of 25 points a side, held at one corner. It is plucked (in1) and touched at
# three places (in2, in3, in4).
@tri_M param 1.
@tri_K param 0.1
@tri_Z param 0.0005
@nlK param 0.1
@nlscale param 0.03

END
  awk -v side=25 'BEGIN {
    for (j = 0; j < side; j++) for (i = 0; i < side - j; i++)
      printf "@tri_m%d_%d %s\n", j, i, j + i == 0 ? "ground 0." : "mass tri_M 0. 0."
    print ""
    for (j = 0; j < side; j++) for (i = 0; i + 1 < side - j; i++)
      printf "@tri_r%d springDamper @tri_m%d_%d @tri_m%d_%d tri_K tri_Z\n", n++, j, i, j, i + 1
    for (j = 0; j < side; j++) for (i = 0; i + 1 < side - j; i++)
      printf "@tri_r%d springDamper @tri_m%d_%d @tri_m%d_%d tri_K tri_Z\n", n++, j, i, j + 1, i
    for (j = 0; j < side; j++) for (i = 0; i + 1 < side - j; i++)
      printf "@tri_r%d springDamper @tri_m%d_%d @tri_m%d_%d tri_K tri_Z\n", n++, j, i + 1, j + 1, i
  }'
  cat <<'END'

@in1 posInput 0.
@in2 posInput 0.
@in3 posInput 0.
@in4 posInput 0.

@touch0 contact @tri_m8_1 @in2 0. 0.01 0.
@touch1 contact @tri_m8_2 @in2 0. 0.01 0.
@touch2 contact @tri_m17_3 @in3 0. 0.01 0.
@touch3 contact @tri_m17_4 @in3 0. 0.01 0.
@touch4 contact @tri_m13_9 @in4 0. 0.01 0.
@touch5 contact @tri_m13_10 @in4 0. 0.01 0.
@pick nlPluck @in1 @tri_m22_1 nlK nlscale

@out1 posOutput @tri_m3_11
@out2 posOutput @tri_m1_5
END
} > LargeTriangleMesh.mdl
