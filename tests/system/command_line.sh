#!/bin/sh
# Tests the command line. Bad input must give a clear message and the right exit code. Rendering twice
# must give the same file. command_line.sh PROGRAM SOURCE_FOLDER. Two long lists are tested by half,
# which RESSORT_TURN selects, or completely, if RESSORT_THOROUGH is set.
set -u
program=$1
source=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
export RESSORT_DATA="$source" JACK_DEFAULT_SERVER=ressort-nobody JACK_NO_START_SERVER=1
failures=0

# expect CODE TEXT COMMAND...: checks the exit code, and that the output contains TEXT.
expect() {
  code=$1
  text=$2
  shift 2
  said=$(timeout 60 "$@" 2>&1 < /dev/null)
  got=$?
  if [ "$got" != "$code" ]; then
    echo "FAILED: $* ended with $got instead of $code, saying: $said"
    failures=$((failures + 1))
  elif ! printf '%s' "$said" | grep -qF -- "$text"; then
    echo "FAILED: $* did not say '$text' but: $said"
    failures=$((failures + 1))
  fi
}

# in_turn: whether the next item of a list is tested.
place=${RESSORT_TURN:-0}
in_turn() {
  place=$((place + 1))
  [ -n "${RESSORT_THOROUGH:-}" ] || [ $((place % 2)) = 0 ]
}

model() { printf '%b' "$2" > "$1"; }

# The command line itself.
expect 2 "Subcommands:" "$program"
expect 2 "nosuch" "$program" nosuch
expect 0 "play" "$program" --help
expect 0 ", commit " "$program" --version
expect 0 '| `posOutput` | `@MASS [LEVEL]` |' "$program" reference model
expect 2 "PART" "$program" reference nosuch
expect 0 "/note/on" "$program" render --help
expect 2 "--osc-port" "$program" play -u 99999999
expect 2 "--web-bind requires --web" "$program" play --web-bind 127.0.0.1
expect 2 "--law requires --sweep" "$program" describe PolyTriangle --law f0_hz=1

# Files.
expect 2 "there is no model or preset 'nosuch.mdl'" "$program" check nosuch.mdl
expect 2 "is a folder" "$program" check "$folder"
: > empty.mdl
expect 2 "empty.mdl:1:1: error: the model is empty" "$program" check empty.mdl
head -c 3000 /dev/urandom > binary.mdl
printf '\0' >> binary.mdl
expect 2 "a binary file, not a model" "$program" check binary.mdl
head -c 52428800 /dev/zero > large.mdl
expect 2 "the limit is 32 MiB" "$program" check large.mdl

# Recordings.
expect 2 "there is no file 'nosuch.wav'" "$program" body nosuch.wav
expect 2 'found a zero byte' "$program" body binary.mdl
model text.wav 'no sound at all'
expect 2 "'text.wav' looks like text; bodies are made of" "$program" body text.wav
printf '0 /note/on 60 100\n' > blow.txt
expect 0 "blow.flac" "$program" render BarMetals --score blow.txt -s 2 -o blow.flac
expect 0 "@blow body 40 hit left right" "$program" body blow.flac
expect 0 "modes from 26" "$program" body blow.flac -o rings.mdl --picture rings.svg
expect 0 "@out2 posOutput [@rings right]" cat rings.mdl
expect 0 "</svg>" cat rings.svg
expect 0 "stable" "$program" check rings.mdl
expect 0 '"frequency_deviation_hz"' "$program" body blow.flac --json
expect 0 "rings.mdl: 1 mode at 26" "$program" body blow.flac --modes 1 -o rings.mdl --force
expect 2 "rings.mdl" "$program" body blow.flac -o rings.mdl
expect 2 "'blow.flac' is an input, so it cannot be the output" "$program" body blow.flac -o blow.flac
expect 2 "ends in .svg" "$program" body blow.flac --picture rings.png
expect 0 "rings.wav" "$program" render Marimba -s 0 -o rings.wav
expect 2 "'rings.wav': " "$program" body rings.wav

# Statistical bodies. The command in a model's head must write the model again.
expect 0 "box.mdl: " "$program" body --statistical 350:0.03,6000:0.03 --loss 0.02 --mass 1.2 \
  --mode 100,20,2,1 --mode 190,30,2.8,1 --mode 250,35,2,1,-1 -o box.mdl
expect 0 "--mode 250,35,2,1,-1" cat box.mdl
expect 0 "stable" "$program" check box.mdl
expect 2 "box.mdl" "$program" body --statistical 100:0.05,900:0.01 --loss 0.02 -o box.mdl
expect 2 "FILE or --statistical is required" "$program" body
expect 2 "FILE excludes --statistical" "$program" body --statistical 9:1,90:1 --loss 1 box.mdl
expect 0 "--floor has no effect on statistics" "$program" body --statistical 9:1,90:1 --loss 1 \
  --floor -9
expect 2 "--seed requires --statistical" "$program" body blow.flac --seed 2
expect 2 "at least two points HZ:DENSITY" "$program" body --statistical 0.05 --loss 0.02
expect 2 "only a recording becomes a preset" "$program" body --statistical 100:0.05,900:0.01 \
  --loss 0.02 -o box.toml
printf '220 0.5 1.2\n447.1 0.3 2\n' > modes.txt
expect 0 "modes.mdl: 2 modes from 220.0 to 447.1 Hz" "$program" body modes.txt -o modes.mdl
expect 0 "--picture has no effect on a resonance model" "$program" body modes.txt --picture a.svg
expect 0 "--material has no effect on a recording" "$program" body blow.flac --material steel
expect 2 "only a recording becomes a preset" "$program" body modes.txt -o modes.toml
expect 2 "needs --loss" "$program" body --statistical 100:0.05,900:0.01
expect 2 "900 modes, more than the limit of 400" "$program" body --statistical 100:1,1000:1 --loss 1
expect 2 "ascending frequencies of 1 to 20000" "$program" body --statistical 900:1,100:1 --loss 1
expect 2 "expected HZ,Q, HZ,Q,BRIDGE" "$program" body --statistical 9:1,90:1 --loss 1 --mode 275
model box.obj 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'
expect 2 "a solid has one loss factor" "$program" body box.obj --loss 100:0.1,900:0.2
command=$(sed -n '/^# ressort body/,/[^\\]$/p' "$source/models/Soundboard.mdl" |
  sed 's/^# *\(ressort\)\{0,1\}//; s/\\$//' | tr '\n' ' ')
# shellcheck disable=SC2086
expect 0 "Soundboard.mdl: 155 modes" "$program" $command
sed -n '/^@/p' "$source/models/Soundboard.mdl" > expected.mdl
sed -n '/^@/p' Soundboard.mdl > written.mdl
expect 0 "same modes" sh -c "cmp expected.mdl written.mdl && echo same modes"

# Descriptions.
expect 0 ", the centroid of the spectrum" "$program" describe blow.flac -o timbre.svg
expect 2 "timbre.svg' exists already" "$program" describe blow.flac -o timbre.svg
expect 2 "ends in .svg" "$program" describe blow.flac -o timbre.png
expect 0 "--note, --seconds, --rate and --motion have no effect on a sound file" \
  "$program" describe blow.flac --note 60
expect 2 "there is no file 'nosuch.wav'" "$program" describe nosuch.wav
expect 2 "there is no model or preset 'nosuch'" "$program" describe nosuch
expect 2 "is not a readable sound file" "$program" describe text.wav
expect 2 "must be one of hann, hamming, blackman, none" "$program" describe blow.flac --window flat
expect 2 "must be a whole number, 4 to 65536" "$program" describe blow.flac --frame 2048.5
expect 2 "at 999999 is not within the sound" "$program" describe blow.flac --at 999999
expect 2 "is silent at key 127" "$program" describe PolyTriangle --note 127 -s 0.1
expect 0 '"window":"blackman","spectrum":"power","closed_form":false,"at":512' \
  "$program" describe blow.flac --json --at 512 --window blackman --spectrum power
expect 2 "is not linear" "$program" describe "$source/models/BowedString.mdl"
model bar.mdl '@s string 9 1. 0.1 0.001 0. 0.\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.7]\n'
expect 0 '"closed_form":true' "$program" describe bar.mdl --json
expect 0 "modes, in closed form" "$program" describe bar.mdl

# Matching a timbre.
model free.mdl '@k param 0.1\n@z param 0.001\n@s string 20 1. k z 0. 0.\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.7]\n'
expect 0 "0.00 JND" "$program" shape free.mdl --f0 300 --t60 3 -o shaped.toml
expect 0 "300.000" "$program" modes shaped.toml --modes 1
expect 2 "shaped.toml' exists already" "$program" shape free.mdl --f0 300 -o shaped.toml
expect 0 "is as high as it gets" "$program" shape free.mdl --f0 20000
expect 0 '"attack_ms"' "$program" shape free.mdl --attack 8 --json
expect 2 "must be a number above 0" "$program" shape free.mdl --attack 0
expect 0 '"k": "highest"' "$program" shape free.mdl --f0 20000 --json
expect 0 "key 60 (C4 +0)" "$program" shape PolyTriangle --note 60 --centroid 400 --json
expect 0 "is as bright as it gets with the other targets" "$program" shape free.mdl --like blow.flac --t60 3
expect 2 "keys set the pitch of PolyTriangle" "$program" shape PolyTriangle --f0 100
expect 2 "bar.mdl:1:1: error: there is no parameter to adjust" "$program" shape bar.mdl --t60 3
expect 2 "here is a bow" "$program" shape BowedString --t60 3
expect 2 "did you mean 'centroid'?" "$program" shape free.mdl --centroit 300
expect 2 "must be a number above 0, found nan" "$program" shape free.mdl --t60 nan
expect 2 "no target; pass a figure" "$program" shape free.mdl
expect 2 "ends in .toml" "$program" shape free.mdl --t60 3 -o shaped.wav
expect 2 "it cannot be the output" "$program" shape shaped.toml --t60 3 -o shaped.toml --force
expect 2 "there is no file 'nosuch.wav'" "$program" shape free.mdl --like nosuch.wav
# The JSON is one object with plain numbers at the top level.
if command -v python3 > /dev/null; then
  "$program" describe blow.flac --json --f0 261.63 > timbre.json
  python3 - timbre.json << 'END' || failures=$((failures + 1))
import json, sys
d = json.load(open(sys.argv[1]))
plain = ("centroid_hz spread_hz skewness kurtosis slope decrease rolloff95_hz flatness crest flux "
         "entropy inharmonicity log_attack_time temporal_centroid_s effective_duration_s").split()
assert all(isinstance(d[key], float) for key in plain), d
assert "odd_to_even" in d and len(d["tristimulus"]) == 3
assert len(d["frames"]) == (d["samples"] - 2048) // 512 + 1
assert all(frame["at"] == 512 * i for i, frame in enumerate(d["frames"]))
assert d["frames"][0]["flux"] is None and d["frames"][1]["flux"] is not None
END
fi

# Error messages with file, line and column.
model word.mdl '@m mass 1. 0. 0.\n@r sprnig @m @m 0.1 0.1\n'
expect 2 "word.mdl:2:4: error: unknown keyword 'sprnig'; did you mean 'spring'?" \
  "$program" check word.mdl
model count.mdl '@m mass 1. 0.\n'
expect 2 "count.mdl:1:14: error: 'mass' takes 3 to 4 arguments (M [G] POSITION MOTION), found 2" \
  "$program" check count.mdl
model name.mdl '@m0 mass 1. 0. 0.\n@r springDamper @m0 @m1 0.1 0.1\n'
expect 2 "name.mdl:2:21: error: no mass is called '@m1'; did you mean '@m0'?" \
  "$program" check name.mdl
model number.mdl '@m mass 1. 0.x 0.\n'
expect 2 "number.mdl:1:12: error: found '0.x' where a number was expected" \
  "$program" check number.mdl
model nan.mdl '@K param nan\n@m mass 1. 0. 0.\n'
expect 2 "nan.mdl:1:10: error: found 'nan'" "$program" check nan.mdl
model light.mdl '@m mass 0. 0. 0.\n'
expect 2 "light.mdl:1:9: error: a mass must be above 0" "$program" check light.mdl
expect 2 '"message": "a mass must be above 0' "$program" check light.mdl --json
model motion.mdl '@m mass 1. 0. 5.\n@g ground 0.\n@r spring @m @g 0.1\n@out1 posOutput @m\n'
# A contact that is stiff for its mass gains energy as it was published.
model contact.mdl '@g ground 0.\n@m osc 1. 0.01 0.0001 0. 0.\n@f contact @m @g 0. 5. 1000.\n@out1 posOutput @m\n'
expect 0 "played with notes: stable" "$program" check contact.mdl
expect 0 "rendered without notes: not proved stable" "$program" check contact.mdl
expect 0 "motion: the position one sample before" "$program" check motion.mdl
expect 0 '"motion": "velocity"' "$program" check motion.mdl --json --motion velocity
expect 2 "--motion" "$program" check motion.mdl --motion sideways
model motion.toml 'model = "motion.mdl"\nmotion = "velocity"\n'
expect 0 "~motion velocity" "$program" check motion.toml --print
expect 0 "motion: a velocity in units per second, as the preset says" "$program" check motion.toml
expect 0 "sample before, as requested" "$program" check motion.toml --motion delayed
model motion.toml 'model = "motion.mdl"\nmotion = "sideways"\n'
expect 2 "motion.toml:2:" "$program" check motion.toml
model still.mdl '@g ground 0.\n@m mass 1. 0. 0.\n@r spring @g @m 0.1\n@out1 posOutput @m\n'
expect 0 '"motion": "either"' "$program" check still.mdl --json
expect 0 "motion: both meanings agree" "$program" check still.mdl
model heard.mdl '@K audioParam @in2\n@o osc 1. K 0. 0. 0.\n@out1 posOutput @o\n'
expect 0 "K            audio input 2" "$program" check heard.mdl
expect 0 '"input": 2,' "$program" check heard.mdl --json

# Printing models: the printed text can be read and prints the same.
model other.mdl '@g ground 0.\n@a cel 1. .1 0.01 0. 0.\n@r spring @g @a 0.1 .001\n@out1 posOutput @a\n'
expect 0 "@r springDamper @g @a 0.1 0.001" "$program" check other.mdl --print
"$program" check other.mdl --print > once.mdl
"$program" check once.mdl --print > twice.mdl
cmp -s once.mdl twice.mdl || { echo "FAILED: printed twice, it differs"; failures=$((failures + 1)); }
expect 2 "no mass is called '@m1'" "$program" check name.mdl --print
expect 2 "excludes" "$program" check other.mdl --print --json
expect 0 "NAME_m0" "$program" make --help
expect 0 "@out1 posOutput" "$program" make string 50
expect 0 "warning: " "$program" make string 10 -K 5
expect 0 "hex.mdl: 92 masses, 241 links" "$program" make hexagon 5 --fixed none -K 0.2 -o hex.mdl
expect 0 "stable" "$program" check hex.mdl
expect 0 "@d closedMesh 150 150 d_M d_K d_Z 0 0" "$program" make closedMesh 150 150 --name d --macro
expect 2 "at least 2 by 2" "$program" make mesh 5
expect 2 "KIND: must be one of string, stiffString" "$program" make sphere 5
expect 2 "at most 100000 points" "$program" make string 100001
expect 2 "a mass must be above 0" "$program" make string 5 -M 0
expect 2 "cannot be written" "$program" make string 5 -o no/such/folder/s.mdl

# The chart: all columns, a row for each method, and the message without gnuplot.
expect 0 "Grey stairs" "$program" chart --help
expect 2 "there is no model or preset 'nosuch'" "$program" chart nosuch -o drawn
expect 0 "no figures: gnuplot, which draws the figures, is not installed" \
  env PATH=/nowhere "$program" chart triangle -t 0.1 -o drawn
grep -qx 'scene,way,precision,.*,front_published,front_physical,failure,also' drawn/chart.csv &&
  grep -q '^triangle,direct,double,direct,1,,[0-9.]*,[0-9.]*,[0-9.]*,[0-9.]*,[01],[01],' drawn/chart.csv &&
  grep -q '^triangle,direct 8x,float,direct,8,' drawn/chart.csv &&
  grep -q '^# scene triangle: ' drawn/chart.csv ||
  { echo "FAILED: the chart's table lacks something"; failures=$((failures + 1)); }
[ "$(grep -c '^triangle,' drawn/chart.csv)" -ge 12 ] ||
  { echo "FAILED: the chart's table lacks methods"; failures=$((failures + 1)); }
model places.mdl '@s string 9 1 0.1 0.001 0 0\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.71]\n'
expect 0 "overview.svg: all scenes" "$program" chart triangle places.mdl -t 0.1 -o drawn
expect 0 "</svg>" cat drawn/triangle.svg
expect 2 "gnuplot, which draws the figures, is not installed" \
  env PATH=/nowhere "$program" modes PolyTriangle -o shapes.svg

# Stability: the unstable element with name and line, and the limits of parameters.
model stiff.mdl '@K param 1.5\n@g ground 0.\n@m osc 1. K 0. 1. 1.\n@out1 posOutput @m\n'
expect 0 "stable; every stiffness may be multiplied by up to 2.66666" "$program" check stiff.mdl
expect 0 "K            1.5        from 0 to 3.99999; stable below 4" "$program" check stiff.mdl
model wild.mdl '@s ground 0.\n@m mass 1. 1. 1.\n@r spring @s @m 5.\n@out1 posOutput @m\n'
expect 2 "wild.mdl:3:1: error: unstable: the stiffness 5 of 'r' must stay below 4; pass --force to play it anyway" \
  "$program" check wild.mdl
expect 2 '"verdict": "unstable"' "$program" check wild.mdl --json
model wild-in.mdl '@s ground 0.\n@m mass 1. 0. 0.\n@r spring @s @m 5.\n@in1 frcInput @m\n@out1 posOutput @m\n'
for command in "0 modes" "2 describe"; do
  expect "${command% *}" "wild-in.mdl:3:1: warning: unstable: the stiffness 5 of 'r' must stay below 4" \
    "$program" "${command#* }" wild-in.mdl
done
expect 2 '"limit": 4.0' "$program" check wild.mdl --json
expect 2 '"ok": false' "$program" check wild.mdl --json
expect 0 '"ok": true' "$program" check stiff.mdl --json
expect 2 "@r spring @s @m 5" "$program" check wild.mdl --print
model wide.toml 'model = "stiff.mdl"\n[parameters]\nK = { value = 1, range = [0, 5] }\n'
expect 0 "stiff.mdl:3:1: warning: unstable: the stiffness K = 5 of 'm' must stay below 4" \
  "$program" check wide.toml
expect 0 "not stable in all ranges of the parameters" "$program" check wide.toml

# Presets.
model broken.toml 'model = "PolyTriangle.mdl\n'
expect 2 "broken.toml:1:" "$program" check broken.toml
model key.toml 'model = "PolyTriangle.mdl"\nvoicse = 3\n'
expect 2 "key.toml:2:10: error: unknown key 'voicse'" "$program" check key.toml
model far.toml 'model = "PolyTriangle.mdl"\nvoices = 1000\n'
expect 2 "'voices' must lie between 1 and 256" "$program" check far.toml
model target.toml 'model = "PolyTriangle.mdl"\n[[control]]\nfrom = "cc1"\nto = "m_Q"\n'
expect 2 "the model has no parameter 'm_Q'; it has m_K, m_Z" "$program" check target.toml
model lost.toml 'model = "nosuch.mdl"\n'
expect 2 "lost.toml:1:9: error: the model 'nosuch.mdl'" "$program" check lost.toml
model two.toml 'model = "name.mdl"\nvoices = 0\n[[control]]\nfrom = "cc1"\nto = "m_Q"\nhow = "x"\n'
expect 2 "two.toml:2:10: error: 'voices' must lie" "$program" check two.toml
expect 2 "two.toml:6:7: error: 'how' must be" "$program" check two.toml
expect 2 "name.mdl:2:21: error: no mass is called '@m1'" "$program" check two.toml
{ printf 'model = "PolyTriangle.mdl"\n'; head -c 60000 /dev/zero | sed 's/\x00/a./g' | head -c 60000
  printf 'a = 1\n'; } > deep.toml
expect 2 "deep.toml:2:18: error: this is nested more than 8 levels deep" "$program" check deep.toml
head -c 65537 /dev/zero > big.toml
expect 2 "the limit is 64 KiB" "$program" check big.toml

# Exporting.
expect 2 "--to" "$program" export PolyTriangle
expect 2 "--to" "$program" export PolyTriangle --to max
expect 0 "faust2" "$program" export --help
expect 0 'hslider("m_K", 0.015, 0.001, 0.2,' "$program" export PolyTriangle --to faust
model mute.mdl '@m mass 1. 0. 0.\n'
expect 2 "mute.mdl:1:1: error: the model has no output" "$program" export mute.mdl --to faust
model plate.mdl '@s string 2000 1. 0.1 0.01 0. 0.\n@out1 posOutput [@s 0.5]\n'
expect 0 "4000 masses and links" "$program" export plate.mdl --to faust -o plate.dsp
expect 0 "plate.dsp: plate as a FAUST program of $(stat -c %s plate.dsp) bytes" \
  "$program" export plate.mdl --to faust -o plate.dsp --force
expect 2 "expected a FAUST file" "$program" export PolyTriangle --to faust -o plate.mdl
expect 2 "cannot be written" "$program" export PolyTriangle --to faust -o no/such/folder/out.dsp
expect 0 "K.csv: PolyTriangle, 2 sounds" \
  "$program" describe PolyTriangle --sweep m_K=0.05:0.1:2 --seconds 0.1 -o K.csv

# Rendering.
expect 2 "there is no file 'nosuch.wav'" \
  "$program" render PolyTriangle -o out.wav --input nosuch.wav
expect 2 "cannot be written" "$program" render PolyTriangle -o no/such/folder/out.wav
model bad.score '0.0 /note/on 60 100\nsoon /note/off 60\n'
expect 2 "bad.score:2:1: error: found 'soon' where a time" \
  "$program" render PolyTriangle -o out.wav --score bad.score
printf 'MThd\0\0\0\6\0\0\0\1\0\140MTrk\0\0\0\17\0\300\5\0\220\74\100\140\200\74\0\0\377\57\0' > change.mid
expect 0 "change.mid: 1 program change ignored" \
  "$program" render PolyTriangle -o out.wav --midi change.mid
model infinite.mdl '@g ground 0.\n@m mass 1. 0. 0.\n@r spring @g @m [0/0]\n'
model late.score '1e300 /note/on 60\n'
expect 2 "where a time in seconds was expected, at most a day" \
  "$program" render PolyTriangle -o out.wav --score late.score
model good.score '0.0 /note/on 60 100\n'
expect 2 "cannot be the output" "$program" render PolyTriangle -o good.score --score good.score
expect 2 "word.mdl' has no known sound file ending; use one of .wav, .w64, .flac, .ogg" \
  "$program" render PolyTriangle -o word.mdl
expect 2 "must be -120 to 60, found nan" "$program" play -g nan
expect 2 "must be 1 to 16, or FROM=TO, found 3=17" "$program" play --channel 3=17
expect 2 "names channel 3 twice" "$program" play --channel 3,3=1
expect 2 "not a finite number" "$program" check infinite.mdl
model wrong.score '0.0 /in/7/force 1\n'
expect 2 "wrong.score:1:5: error: /in/7/force" \
  "$program" render PolyTriangle -o out.wav --score wrong.score
expect 2 "PolyTriangle.toml:$(grep -n '^m_K' "$source/presets/PolyTriangle.toml" | cut -d: -f1):" \
  "$program" render PolyTriangle -o out.wav --set m_K=7
expect 2 "error: the preset limits 'm_K' to" \
  "$program" render PolyTriangle -o out.wav --set m_K=7

expect 2 "--set m_Q=1: /param/m_Q: the model has no such parameter; it has m_K, m_Z" \
  "$program" render PolyTriangle -o out.wav --set m_Q=1
model marked.score '\357\273\2770.0 /note/on 60 100\n'
expect 0 "peak -" "$program" render PolyTriangle -o out.wav --score marked.score --seconds 0.1
expect 0 "peak -" sh -c 'exec "$0" render PolyTriangle -o out.wav --score - -s 0.1 <marked.score' "$program"
printf 'MThd\0\0\0\6' >tune.score
expect 2 "tune.score' is a MIDI file; pass it with --midi" \
  "$program" render PolyTriangle -o out.wav --score tune.score
model wide.score '\377\3760\0'
expect 2 "wide.score' is text in UTF-16" "$program" render PolyTriangle -o out.wav --score wide.score
expect 0 "the number of cores of this machine" \
  "$program" render PolyTriangle -o out.wav --seconds 0.1 --threads 1024
mkfifo pipe
expect 2 "pipe' is not a regular file" "$program" render PolyTriangle -o out.wav --input pipe

# Files: input files and existing files are never lost, under any name.
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
model own.mdl '@g ground 0.\n@m osc 1. .1 .001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n'
model own.toml 'model = "own.mdl"\n'
model own.score '0 /in/1/force 1\n'
"$program" render own.mdl -q -o in.wav --score own.score --seconds 0.1
mkdir before sub
for file in own.mdl own.toml own.score in.wav; do
  cp "$file" before
  ln -s "$file" "soft-$file.wav"
  ln "$file" "hard-$file.wav"
  for name in "soft-$file.wav" "hard-$file.wav" "./hard-$file.wav" "sub/../hard-$file.wav" \
    "$folder/hard-$file.wav"; do
    expect 2 "cannot be the output" \
      "$program" render own.toml -o "$name" --input in.wav --score own.score
    expect 2 "" "$program" export "$file" --to faust -o "$name" --force
  done
done
for name in in.wav ./in.wav sub/../in.wav "$folder/in.wav"; do
  expect 2 "cannot be the output" "$program" render own.mdl -o "$name" --input in.wav
done
expect 2 "cannot be the output" "$program" export own.mdl --to faust -o hard-own.mdl.wav --force
expect 2 "is not a sound file, so it is not overwritten" "$program" render own.mdl -o hard-own.score.wav
for file in own.mdl own.toml own.score in.wav; do
  cmp -s "$file" "before/$file" || fail "$file was written over"
done
expect 0 "peak" "$program" render own.mdl -o again.wav --score own.score --seconds 0.1
expect 0 "peak" "$program" render own.mdl -o again.wav --score own.score --seconds 0.1
cmp -s in.wav again.wav || fail "a sound that was there is not written over"
for command in "make string 5" "export own.mdl --to faust"; do
  printf 'mine' > there.txt
  # shellcheck disable=SC2086
  expect 2 "there.txt' exists already; --force" "$program" $command -o there.txt
  [ "$(cat there.txt)" = mine ] || fail "$command wrote over a file unasked"
  # shellcheck disable=SC2086
  expect 0 "" "$program" $command -o there.txt --force
  [ "$(cat there.txt)" = mine ] && fail "$command --force did not write"
done

# File name endings.
for ending in wav w64 flac ogg aiff aif au caf WAV; do
  expect 0 "peak" "$program" render own.mdl -o "all.$ending" --score own.score --seconds 0.5
  expect 0 "0.50 s" "$program" render own.mdl -o out.wav --input "all.$ending" --seconds 0.5
done
expect 2 "has no known sound file ending" "$program" render own.mdl -o all.mp4
expect 2 "pipe' is a pipe" "$program" render own.mdl -o pipe
expect 2 "a .flac holds pcm24, but no floats" "$program" render own.mdl -o all.flac --format double
expect 2 "a .ogg holds compressed samples only" "$program" render own.mdl -o all.ogg --format pcm24
expect 2 "a .au is limited to 4 GB" "$program" render own.mdl -o big.au --seconds 86400

# Full disks.
expect_full() {
  said=$(timeout 60 "$@" 2>&1 > /dev/full < /dev/null)
  got=$?
  [ "$got" = 1 ] && printf '%s' "$said" | grep -q "the output is incomplete" ||
    fail "$* to a full disk ended with $got, saying: $said"
}
expect_full "$program" check own.mdl
expect_full "$program" check own.mdl --json
expect_full "$program" check own.mdl --print
expect_full "$program" export own.mdl --to faust
expect_full "$program" make string 500
expect_full "$program" --help
said=$("$program" check own.mdl 2>&1 >&-)
[ $? = 1 ] || fail "a closed stdout is no failure: $said"
expect 1 "No space left on device" "$program" make string 500 -o /dev/full
expect 1 "failed: File too large" \
  sh -c 'ulimit -f 64; exec "$@"' - "$program" render own.mdl -o again.wav --seconds 10
cmp -s in.wav again.wav || fail "what was there is lost on a full disk"

# Ctrl-C in each stage of a solid. The meshers never end.
mkdir meshers
printf '#!/bin/sh\nexec sleep 60\n' > meshers/gmsh
printf '#!/bin/sh\nexit 3\n' > meshers/failing
chmod +x meshers/*
interrupted() {
  stage=$1
  shift
  rm -f stages.log
  PATH="$PWD/meshers:$PATH" script -qefc "exec '$program' body box.obj --material steel \
    -o solid.mdl $*" stages.log > stages &
  screen=$!
  for _ in $(seq 200); do
    grep -q "$stage" stages.log 2> /dev/null && break
    sleep 0.05
  done
  solid=$(cat "/proc/$screen/task/$screen/children")
  kill -INT "${solid% }"
  wait "$screen"
  got=$?
  [ "$got" = 1 ] && grep -q "$stage" stages.log && grep -q "box.obj: interrupted" stages.log &&
    [ ! -e solid.mdl ] ||
    fail "Ctrl-C while $stage: exit $got, saying: $(cat stages.log)"
}
interrupted "meshing with gmsh" --mesher gmsh
cp meshers/gmsh meshers/tetgen
cp meshers/failing meshers/gmsh
interrupted "meshing with tetgen"
cp meshers/failing meshers/tetgen
interrupted "meshing with a grid" --unknowns 100000
interrupted "finding its modes" --mesher own --unknowns 10000

# Signals during a render: the rendered part is kept as a valid file.
for signal in TERM HUP INT; do
  "$program" render own.mdl -q -o "cut$signal.wav" --seconds 86000 &
  rendering=$!
  for _ in $(seq 100); do
    [ "$(stat -c %s "cut$signal.part.wav" 2> /dev/null || echo 0)" -gt 100000 ] && break
    sleep 0.05
  done
  kill "-$signal" "$rendering"
  wait "$rendering"
  got=$?
  size=$(stat -c %s "cut$signal.wav")
  told=$(od -An -tu4 -j4 -N4 "cut$signal.wav")
  [ "$got" = 1 ] && [ "$size" -gt 100000 ] && [ "$((told + 8))" = "$size" ] ||
    fail "SIG$signal in a render: exit $got, $size bytes, the header says $told"
done
rm -f cut*.wav
"$program" render own.mdl -q -o killed.wav --seconds 86000 &
rendering=$!
for _ in $(seq 100); do
  told=$(od -An -tu4 -j4 -N4 killed.part.wav 2> /dev/null || echo 0)
  [ "${told:-0}" -gt 100000 ] && break
  sleep 0.1
done
kill -KILL "$rendering"
wait "$rendering" 2> /dev/null
[ "$told" -gt 100000 ] || fail "the header of a killed render says $told bytes"
rm -f killed.part.wav
[ -z "$(find . -name '*.part*')" ] || fail "left behind: $(find . -name '*.part*')"

# The stability check.
expect 2 "wild.mdl:3:1: error: unstable: the stiffness 5 of 'r' must stay below 4; pass --force to play it anyway" \
  "$program" render wild.mdl -o wild.wav --seconds 1
expect 0 "faded out, because it became unstable; lower its stiffness or damping, or raise its mass" \
  "$program" render wild.mdl -o wild.wav --seconds 1 --force
# A stable model is not to blame for a force beyond all numbers.
printf '0.1 /in/1/force 1e30\n' > hard.score
expect 0 "faded out, because it was pushed too hard; lower the force; the output is not valid" \
  "$program" render PolyTriangle -o hard.wav --seconds 0.5 --score hard.score
expect 0 "wild.mdl:3:1: warning: unstable: the stiffness 5 of 'r'" \
  "$program" render wild.mdl -o wild.wav --seconds 1 --force
expect 2 "wild.mdl:3:1: error: unstable" "$program" play wild.mdl -a dummy -i
# All commands give the same answer.
model zero.mdl '@P param 0\n@g ground 0.\n@m mass 1. 0. 0.\n@r spring @g @m 1/P\n@out1 posOutput @m\n'
expect 2 "zero.mdl:4:1: error: the argument 1/P of 'r' is not finite when P = 0" \
  "$program" check zero.mdl
for refused in wild.mdl zero.mdl light.mdl two.toml target.toml; do
  "$program" check $refused 2>&1 > checked.out | grep error: > checked
  "$program" render $refused -o refused.wav 2>&1 < /dev/null | grep error: > rendered
  "$program" play $refused -a dummy -r 44100 -u off -m none -i 2>&1 < /dev/null |
    grep error: > played
  if ! [ -s checked ] || ! cmp -s checked rendered || ! cmp -s checked played; then
    echo "FAILED: check, render and play of $refused differ:" "$(cat checked rendered played)"
    failures=$((failures + 1))
  fi
done
# Inaudible models can be played, rendered and checked, with a warning.
silent="mute.mdl:1:1: warning: the model has no output, so it will be silent"
expect 0 "$silent" "$program" check mute.mdl
expect 0 "$silent" "$program" render mute.mdl -o mute.wav --seconds 0.1
printf 'quit\n' > quit.script
expect 0 "$silent" "$program" play mute.mdl -a dummy -u off -m none -e quit.script
expect 0 "would let keys strike it" "$program" play mute.mdl -a dummy -u off -m none -e quit.script
expect 0 "--paused has no effect" "$program" play -a dummy -u off -m none -e quit.script --paused
expect 0 "--connect has no effect without JACK" \
  "$program" play -a dummy -u off -m none -e quit.script --connect
expect 0 "--device has no effect without ALSA" \
  "$program" play -a dummy -u off -m none -e quit.script -d hw:1
expect 0 "--osc-reply and --osc-allow have no effect with -u off" \
  "$program" play -a dummy -u off -m none -e quit.script --osc-reply 9000
expect 0 "wide.toml:3:5: warning: 'K' is kept below 3.99999; above it the model is not stable" \
  "$program" render wide.toml -o wide.wav --seconds 1
expect 0 "K: 4.5 is beyond the stable range, set to 3.99999" \
  "$program" render wide.toml -o wide.wav --seconds 1 --set K=4.5
expect 2 "the stiffness K = 4.5 of 'm' must stay below 4" \
  "$program" render stiff.mdl -o stiff.wav --seconds 1 --set K=4.5
expect 0 "peak" "$program" render stiff.mdl -o stiff.wav --seconds 1 --set K=3.9
model steep.score '0.1 /param/K 4.5\n0.2 /param/K 9\n'
expect 0 "steep.score:1:5: warning: K: 4.5 is beyond the stable range, set to 3.99999" \
  "$program" render stiff.mdl -o stiff.wav --score steep.score
# At half the rate the same numbers are four times as stiff.
expect 2 "the stiffness K = 1.5 of 'm' must stay below 1, at 22050 Hz" \
  "$program" render stiff.mdl -o stiff.wav --seconds 1 --rate 22050
expect 0 "peak" "$program" render stiff.mdl -o stiff.wav --seconds 1 --rate 22050 --no-rescale
# A contact that may never touch is accepted with a warning.
model hard.mdl '@g ground 0.\n@m osc 1. 0.1 0.001 0. 0.\n@c contact @m @g 9 0.1 0.\n@in1 frcInput @m\n@out1 posOutput @m\n'
expect 0 "the stiffness 9 of 'c' must stay below" "$program" check hard.mdl --budget passive=never

# A pitch or decay budget that is not kept gives a warning, with --strict an error.
model damped.mdl '@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@l springDamper @g @a 0.9 0.1
@k springDamper @a @b 0.6 0.08\n@in1 frcInput @a\n@out1 posOutput @b\n'
expect 0 '"kept": true' "$program" check damped.mdl --budget cents=3 --json --strict
expect 0 '"kept": false' "$program" check damped.mdl --budget cents=0.0001 --json
expect 0 "the budget cents=0.0001 is not kept" "$program" check damped.mdl --budget cents=0.0001
expect 2 "the budget cents=0.0001 is not kept" \
  "$program" check damped.mdl --budget cents=0.0001 --strict
# A bare model has exact modes, unless audio changes its parameters.
expect 0 "peak" "$program" render damped.mdl -o damped.wav --budget cents=1e-6 --seconds 1 --strict
model turned.mdl '@w audioParam @in2\n@g ground 0.\n@a mass 1. 0. 0.\n@r springDamper @g @a [0.3+0.01*w] 0.02\n@b mass 1. 0. 0.
@s springDamper @a @b 0.3 0.\n@in1 frcInput @a\n@out1 posOutput @b\n'
expect 0 "the budget cents=1e-06 is not kept" \
  "$program" render turned.mdl -o turned.wav --budget cents=1e-6 --seconds 1
expect 2 "the budget cents=1e-06 is not kept" \
  "$program" render turned.mdl -o turned.wav --budget cents=1e-6 --seconds 1 --strict
expect 0 "1 contact made passive: as published it could gain" "$program" check hard.mdl
expect 0 "peak" "$program" render hard.mdl -o hard.wav --seconds 1
model push.score '0 /in/1/force nan\n'
expect 2 "must be a number" "$program" render PolyTriangle -o out.wav --score push.score

# Playing without audio devices.
expect 75 "no JACK server answers to the name 'ressort-nobody'" "$program" play -a jack -i
expect 75 "cannot open the ALSA device" "$program" play -a alsa -d nosuchdevice -i
expect 2 "there is no model or preset 'nosuch'" "$program" play nosuch -a dummy -i

# Long loads. A signal ends them at any point, with the usual exit status.
play="play -a dummy -m none -u off"
model large.mdl '@K param 0.01\n@s mesh 700 700 1. K 0.001 0. 0.\n@in1 frcInput [@s 0.2 0.2]
@out1 posOutput [@s 0.3 0.3]\n'
printf 'load large\n' > load.txt
ends() {
  signal=$1
  delay=$2
  shift 2
  timeout -s "$signal" -k 30 --preserve-status "$delay" "$@" > ends.log 2>&1
  got=$?
  # During start-up a signal ends the program as usual.
  case $got in
    0 | 129 | 130 | 143) ;;
    *)
      echo "FAILED: SIG$signal after $delay s of '$*': ended with $got, saying: $(cat ends.log)"
      failures=$((failures + 1))
      ;;
  esac
}
for delay in 0.1 0.3 0.6 1 1.5 2.5; do
  in_turn && ends TERM "$delay" "$program" $play -i large.mdl < /dev/null
  in_turn && ends INT "$delay" "$program" $play < load.txt
  in_turn && ends HUP "$delay" "$program" $play -i -e load.txt < /dev/null
done
# Models that need too much memory are rejected, and the console continues.
model huge.mdl '@s string 3900000 1. 0.1 0. 0. 0.\n@out1 posOutput [@s 0.3]\n'
said=$(ulimit -v 700000; printf 'load huge\nparams\nquit\n' | timeout 60 "$program" $play 2>&1)
got=$?
case $got:$said in
  0:*"'huge' could not be loaded: not enough memory"*m_K*) ;;
  *)
    echo "FAILED: a load without memory ended with $got, saying: $said"
    failures=$((failures + 1))
    ;;
esac
expect 2 "not enough memory" sh -c "ulimit -v 700000; $program check huge.mdl"

"$program" play PolyTriangle -a dummy -m none -i -u 19783 > first.log 2>&1 &
first=$!
for _ in 1 2 3 4 5 6 7 8 9 10; do
  grep -q "OSC on" first.log && break
  sleep 0.2
done
printf 'quit\n' > quit.script
expect 0 "playing without OSC: port 19783 of 127.0.0.1 is taken, perhaps by another ressort; choose another with -u 19784" \
  "$program" play -a dummy -m none -i -u 19783 -e quit.script
expect 0 "port 19784, accessible from this machine and 10.0.0.0/8" "$program" play -a dummy -m none -i \
  -u 19784 -B 0.0.0.0 --osc-allow 10.0.0.0/8 -e quit.script
expect 2 "name the allowed senders with --osc-allow" "$program" play -a dummy -m none -i -B 0.0.0.0
expect 2 "--osc-allow 10.0.0.5 needs -B too" "$program" play -a dummy -i --osc-allow 10.0.0.5
kill -TERM "$first"
wait "$first"
[ $? = 0 ] || { echo "FAILED: SIGTERM did not end the program with 0"; failures=$((failures + 1)); }

# Closed output: ressort runs its script, records, and ends on request.
mkfifo stalled
sleep 60 < stalled &
reader=$!
{
  yes help | head -n 1000
  echo "rec stage.wav"
} > talk
"$program" play PolyTriangle -a dummy -m none -i -u off -e talk > stalled 2>&1 &
player=$!
for _ in $(seq 100); do
  [ "$(stat -c %s stage.wav 2> /dev/null || echo 0)" -gt 100000 ] && break
  sleep 0.1
done
kill -HUP "$player"
for _ in $(seq 100); do
  kill -0 "$player" 2> /dev/null || break
  sleep 0.1
done
kill -KILL "$player" 2> /dev/null && fail "a stalled stdout keeps the program from ending"
wait "$player"
kill "$reader"
size=$(stat -c %s stage.wav)
[ "$size" -gt 100000 ] && [ "$(($(od -An -tu4 -j4 -N4 stage.wav) + 8))" = "$size" ] ||
  fail "a recording that SIGHUP ended has $size bytes"

# The same for a terminal that no longer shows output.
awk 'BEGIN {
  print "@g ground 0.\n@m osc 1. .1 .001 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m"
  for (i = 0; i < 1000; i++) print "@parameter_" i " param 1"
}' > many.mdl
printf 'rec screen.wav\nparams\nparams\nparams\n' > asked
mkfifo keyboard
script -qec "kill -STOP \$PPID; exec '$program' play many.mdl -a dummy -m none -u off -e asked" \
  screen.log < keyboard > screen &
screen=$!
exec 8> keyboard
for _ in $(seq 100); do
  [ "$(stat -c %s screen.wav 2> /dev/null || echo 0)" -gt 50000 ] && break
  sleep 0.1
done
player=$(cat "/proc/$screen/task/$screen/children")
player=${player% }
kill -TERM "$player"
for _ in $(seq 100); do
  grep -q '^State:.*Z' "/proc/$player/status" && break
  sleep 0.1
done
grep -q '^State:.*Z' "/proc/$player/status" || fail "a stalled terminal keeps the program from ending"
kill -KILL "$player"
kill -CONT "$screen"
exec 8>&-
wait "$screen"
size=$(stat -c %s screen.wav)
[ "$size" -gt 50000 ] && [ "$(($(od -An -tu4 -j4 -N4 screen.wav) + 8))" = "$size" ] ||
  fail "a recording that SIGTERM ended has $size bytes"

# Rendering twice gives the same file, with an audible phrase.
expect 0 "peak" "$program" render IPlayTheTriangle -o one.wav
expect 0 "peak" "$program" render IPlayTheTriangle -o two.wav
cmp -s one.wav two.wav || { echo "FAILED: two renders differ"; failures=$((failures + 1)); }
for preset in "$source"/presets/*.toml; do
  in_turn || continue
  expect 0 "peak -" "$program" render "$preset" --limit -o phrase.wav --seconds 1
done

[ "$failures" = 0 ] && echo "all as expected"
exit "$((failures > 0))"
