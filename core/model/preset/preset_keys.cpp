// Table of all keys of a preset, used by the parser, its messages and the document.
#include "core/model/preset/preset.h"

namespace ressort::model {
namespace {

// clang-format off
constexpr PresetKey keys[] = {
    {"", "model", "text", "the model, beside the preset or in the models folder; required"},
    {"", "with", "[\"NAME.mdl\", ...]", "up to 16 more models that are read as one text with it"},
    {"", "through", "[\"NAME.mdl\", ...]", "up to 8 models, each computed once, that the sum of all voices passes through in this order"},
    {"", "description", "text", "one line for the player"},
    {"", "voices", "1 to 256 (1)", "number of notes that sound at the same time"},
    {"", "gain", "0 to 1e9 (1)", "output per unit of position; a forte note should peak near -12 dBFS"},
    {"", "damper_s", "0 to 60 (0), or [[21, 0.4], [88, 0.2], [89, 0]]", "T60 of a note after its key is released, also by key; 0 lets it ring out"},
    {"", "keys_db", "-40 to 40 (0), or [[36, 7], [60, 0]]", "level added to `gain`, also by key"},
    {"", "noise", "true or false (false)", "whether the outputs modulate white noise instead of being heard"},
    {"", "tuning", "`keyboard` or `fixed` (`keyboard`)", "`keyboard`: a key sets the pitch; `fixed`: every key plays the model as written"},
    {"", "fixed", "[\"LABEL\", ...]", "labels of elements that keys do not retune: bodies, waveguides, macros, oscillators and links"},
    {"", "flattening_cents", "-100 to 100 (0), or [[48, 8], [96, 6]]", "amount by which the sound is flatter than its lowest mode, as under a bow, also by key; keys compensate for it"},
    {"", "tuned_along", "text", "a parameter that keys compensate for, such as a damper that would flatten them; the parameter of a `[morph]` always is"},
    {"", "hardness", "text", "a name in `[parameters]` that the model need not have; its value is added to the velocity, 0 to 1, for `length_ms` of blows"},
    {"", "transpose", "-96 to 96 (0)", "semitones added to each key; `--transpose` adds more"},
    {"", "a4_hz", "220 to 880 (440)", "frequency of the A above middle C, Hz"},
    {"", "scale", "text", "a Scala file beside the preset with the steps between keys; not with `tuning = \"fixed\"`"},
    {"", "keyboard_map", "text", "a Scala keyboard map beside the preset"},
    {"", "channels", "[1, 2, ...] (all)", "MIDI channels to receive"},
    {"", "velocity", "-1 to 1 (0), or [[0, 0], [64, 90], [127, 127]]", "velocity curve: below 0 softer, above 0 louder; or up to 16 points"},
    {"", "play", "`poly`, `mono` or `legato` (`poly`)", "`mono`: one note per channel, that of the last key pressed, which ends the one before; `legato`: the same, without a new strike while a key is down"},
    {"", "glide_s", "0 to 60 (0)", "glide time between notes; in legato only between overlapping notes"},
    {"", "motion", "`velocity` or `delayed`", "meaning of the last argument of a mass; overrides the model"},
    {"", "budget", "text", "accuracy, as for `--budget`: `cents=3 t60=5 silence=-60 passive=auto`"},
    {"", "precision", "`double` or `float` (`double`)", "floating-point format of the voices and bodies; `--precision` replaces it"},
    {"", "parameters", "a table", "the model's parameters by name"},
    {"", "control", "tables, one for each `[[control]]`", "the sources that play the model"},
    {"", "lfo", "tables, one for each `[[lfo]]`", "up to 8 oscillators of every note"},
    {"", "variation", "a table", "small random differences from note to note"},
    {"", "morph", "a table", "a path through several presets of one structure"},
    {"parameters", "value", "a number", "start value; required"},
    {"parameters", "range", "[low, high]", "range of values; required"},
    {"parameters", "keys", "[[21, 5e-5], [108, 4e-3]]", "each voice has its key's value. In a range above 0 equal ratios join the points, and a knob multiplies all values by its own value over `value`; in any other range a knob adds the difference. Not with `tuning = \"fixed\"`"},
    {"parameters", "velocity", "[[0, 0.8], [127, 1.2]]", "factor, by velocity after the preset's curve, on the value of the voice; an offset in a range that is not above 0. `range` limits the result"},
    {"parameters", "keys_at", "a number (`value`)", "the knob's value at which `keys` holds as written; `save` adds it"},
    {"control", "from", "text", "`note`, `release` (of a key, with its release velocity), `pressure`, `cc0` to `cc119`, `audio1` to `audio64`, an OSC name such as `/finger`, or the name of an `[[lfo]]`; required"},
    {"control", "to", "text", "an input, such as `in1`, or a parameter; for an LFO `pitch` (cents), `level` (dB) or a parameter, which it moves in each voice; required"},
    {"control", "name", "text", "of a controller: the knob's name, such as \"Brightness\". All controls with the same `from` are one knob"},
    {"control", "help", "text", "one line about the knob"},
    {"control", "how", "one of the words below", "default: moves an input or sets a parameter"},
    {"control", "range", "[low, high] ([0, 1])", "values for the softest and the loudest: positions, forces, parameter values, or speeds per sample at 44 100 Hz; for notes also by key: `{ keys = [[21, 0.1, 1], [108, 0.2, 2]] }`"},
    {"control", "unit", "`position` or `swing` (`position`)", "for a touch: unit of `range`. One swing is the displacement of a loud note: -2 is off the string, 0 touches it at rest, 1 presses as deep as the string moves"},
    {"control", "curve", "`linear` or `exponential` (`linear`)", "`exponential`: equal steps are equal ratios"},
    {"control", "travel", "above 0", "for a pluck, which requires it: distance of the finger from the string on either side; also by key"},
    {"control", "level_db", "[low, high]", "gain of the softest and the loudest, added to `gain`, also by key. It does not change the gesture, except that it scales the force of an `impulse` with `tuning = \"fixed\"`. Without it `range` determines the level"},
    {"control", "length_ms", "[longest, shortest] (one sample)", "for an impulse or a swing: duration of the softest and the hardest blow at the model's own pitch. For noise, which requires it: T60 of the softest and the hardest burst. For a bow with `level_db`: time in which the level of the softest and the loudest stroke rises. Also by key"},
    {"control", "follows_pitch", "true or false (true)", "for a pluck, a bow, an impulse or a swing: whether durations, speeds and forces scale with the key's pitch, so that all keys have the same timbre"},
    {"control", "band_hz", "[low, high] ([20, 20000])", "for noise, and for a bow with `noise`: -3 dB points of a one-pole highpass and a one-pole lowpass, the same on every key"},
    {"control", "noise", "0 to 1 (0)", "for a bow: rms noise of its speed, as a share of the speed"},
    {"control", "round_robin", "[place, of how many]", "for notes: controls with [1, 2] and [2, 2] alternate from note to note"},
    {"control", "keys", "[low, high] ([0, 127])", "for notes and releases: range of keys"},
    {"lfo", "name", "text", "name for `from` in a control; required"},
    {"lfo", "rate_hz", "0.01 to 50 (5)", "oscillations per second; of the random shapes, values per second; of a fall, time constants per second"},
    {"lfo", "beats", "0.01 to 100", "length of an oscillation in beats of a MIDI clock or of JACK's transport (120 per minute without a clock), in place of `rate_hz`"},
    {"lfo", "delay_s", "0 to 60 (0)", "time from the start of the note to the start of the oscillation"},
    {"lfo", "fade_s", "0 to 60 (0)", "time from there to the full depth"},
    {"lfo", "shape", "`sine`, `triangle`, `random`, `steps` or `fall` (`sine`)", "`random`: straight lines between random points; `steps`: random values, kept until the next one; `fall`: from the top of `range` to its middle, exponentially"},
    {"lfo", "depth", "0 to 1 (1)", "share of the control's `range`, around its middle"},
    {"lfo", "deviation", "0 to 1 (0)", "greatest relative difference of the rate from note to note"},
    {"lfo", "by", "`level`, `pressure`, or `cc0` to `cc119`", "scales the depth, which is constant without it. `level`: by the square of the gain that `level_db` gives the note, so that the pitch of a drum follows its tension. A controller is then a knob with the LFO's name"},
    {"variation", "strength", "0 to 1 (0)", "greatest relative difference of the strength, after the velocity curve"},
    {"variation", "timing_ms", "0 to 50 (0)", "notes start up to this late"},
    {"morph", "parameter", "text", "name of the parameter that moves along the path: 1 is the first stop, 2 the second; required"},
    {"morph", "through", "[\"NAME\", { m_K = 0.1, gain = 0.5 }, ...]", "2 to 16 presets with the structure of `model`, or values of its parameters, each with an optional `gain`. The names in `[parameters]` remain separate knobs; required"},
};
// clang-format on

}  // namespace

std::span<const PresetKey> preset_keys() {
  return keys;
}

}  // namespace ressort::model
