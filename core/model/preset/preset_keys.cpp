// The keys of a preset, which its reader, its messages and its document know from here.
#include "core/model/preset/preset.h"

namespace ressort::model {
namespace {

// clang-format off
constexpr PresetKey keys[] = {
    {"", "model", "text", "the model's file, `NAME.mdl`, beside the preset or in the folder of the models; needed"},
    {"", "with", "[\"NAME.mdl\", ...]", "up to 16 more models that are read as one text with it: a guitar's box behind its string, say"},
    {"", "description", "text", "one line for the person who loads it"},
    {"", "voices", "1 to 256 (1)", "how many notes sound at once"},
    {"", "gain", "0 to 1e9 (1)", "output per unit of position; a forte note should peak near -12 dBFS"},
    {"", "damper_s", "0 to 60 (0)", "T60 of a note once its key is up: in how many seconds a damper takes 60 dB off it; 0 lets it ring out"},
    {"", "decay_s", "0.001 to 600, or [[36, 12], [96, 2]]", "T60 of a note while its key is down, beside what the model itself loses (1/T60 is the sum of both); or points of keys and seconds, up to 16, and straight lines between them, so that low keys ring longer; for what is struck or plucked"},
    {"", "keys_db", "-40 to 40 (0), or [[36, 7], [60, 0]]", "how much louder notes are beside `gain`; or points of keys and dB, up to 16, and straight lines between them, where a model is softer at one end of the keyboard"},
    {"", "noise", "true or false (false)", "the outputs shape white noise instead of being heard themselves"},
    {"", "tuning", "`keyboard` or `fixed` (`keyboard`)", "whether a key sets the pitch, or every key sounds the model as it is written"},
    {"", "fixed", "[\"LABEL\", ...]", "what keys leave as stiff as it is: a guitar's box, whose modes stay where they are while the string follows the key. Labels of bodies, waveguides, macros, oscillators and links"},
    {"", "flattening_cents", "-100 to 100 (0), or [[48, 8], [96, 6]]", "by how much the sound is flat of its lowest mode, as under a bow, which keys make up for; or points of keys and cents, up to 16, and straight lines between them"},
    {"", "pitch_mode", "1 to 16 (1)", "which of the model's modes a key tunes, counted from the lowest: of a bell, say, the one that is heard as its pitch"},
    {"", "tuned_along", "text", "one of `[parameters]` that leaves keys in tune wherever it is turned to, as a damper's that would flatten them a little; that of a `[morph]` does so by itself"},
    {"", "transpose", "-96 to 96 (0)", "semitones between a key and the pitch that it sets"},
    {"", "a4_hz", "220 to 880 (440)", "the pitch of the A above the middle C, to which all keys are tuned"},
    {"", "scale", "text", "a Scala file beside the preset, `NAME.scl`: the steps between keys; `tuning = \"fixed\"` has none"},
    {"", "keyboard_map", "text", "a Scala keyboard map beside the preset, `NAME.kbm`: which key plays which step, and at what pitch"},
    {"", "channels", "[1, 2, ...] (all)", "the MIDI channels that it listens to"},
    {"", "velocity", "-1 to 1 (0), or [[0, 0], [64, 90], [127, 127]]", "how loud a touch is: below 0 softer, above 0 louder, the ends as they are; or points, up to 16, and straight lines between them"},
    {"", "play", "`poly`, `mono` or `legato` (`poly`)", "mono: one voice on each channel plays the last of the keys that are down; legato: and it is not struck again while one is"},
    {"", "glide_s", "0 to 60 (0)", "how long it takes from one pitch to the next; with legato only where keys overlap"},
    {"", "motion", "`velocity` or `delayed`", "what the last argument of a mass means, whatever the model says"},
    {"", "budget", "text", "how exact, as `--budget` takes it: `cents=3 t60=5 silence=-60 passive=auto`"},
    {"", "parameters", "a table", "the model's parameters by name"},
    {"", "control", "tables, one for each `[[control]]`", "what plays the model"},
    {"", "morph", "a table", "a way through several presets of one structure, on which keys stay in tune"},
    {"parameters", "value", "a number", "what the parameter is at first; needed"},
    {"parameters", "range", "[low, high]", "between what it may be turned; needed"},
    {"control", "from", "text", "`note`, `pressure`, `cc0` to `cc119`, `audio1` to `audio64`, or an OSC name such as `/finger`; needed"},
    {"control", "to", "text", "an input, such as `in1`, or a parameter; needed"},
    {"control", "how", "see below", "without it an input is moved and a parameter is turned"},
    {"control", "range", "[low, high] ([0, 1])", "what the softest and the loudest become: positions, forces, a parameter's values, or speeds per sample at 44 100 Hz"},
    {"control", "unit", "`position` or `swing` (`position`)", "of a touch: what `range` counts in. A swing is how far a loud note moves what sounds, measured as the model is loaded: at -2 the finger is off, at 0 it lies where what rests would feel it, at 1 it is pressed as deep as that swings, whatever the masses and springs"},
    {"control", "curve", "`linear` or `exponential` (`linear`)", "exponential: equal steps are equal ratios"},
    {"control", "travel", "above 0", "of a pluck, which needs it: how far from the string the finger rests, on either side"},
    {"control", "level_db", "[low, high]", "how loud the softest and the loudest are beside `gain`; exact for plucks, bows and blows, whose sound does not depend on how large it is. Without it the level is what `range` makes of it"},
    {"control", "length_ms", "[longest, shortest] (one sample)", "of an impulse or a swing: how long the softest and the hardest blow last at the model's own pitch, on higher keys less; the shorter, the brighter"},
    {"control", "round_robin", "[place, of how many]", "of notes: controls of [1, 2] and [2, 2] take turns from note to note, as two hammers do, or strokes up and down"},
    {"control", "keys", "[low, high] ([0, 127])", "of notes: which keys"},
    {"morph", "parameter", "text", "the name of the parameter that goes through them: 1 is the first, 2 the second; controls turn it as any other. Needed"},
    {"morph", "through", "[\"NAME\", { m_K = 0.1, gain = 0.5 }, ...]", "2 to 16 presets of the structure that `model` has, or values of its parameters, each with a `gain` as a preset's. What `[parameters]` names stays a knob of its own; the other parameters are where each stop has them. Needed"},
};
// clang-format on

}  // namespace

std::span<const PresetKey> preset_keys() {
  return keys;
}

}  // namespace ressort::model
