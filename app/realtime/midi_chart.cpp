#include "app/realtime/midi_chart.h"

namespace ressort::realtime {
namespace {

// clang-format off
constexpr MidiChartRow rows[] = {
    {"channels", "1 to 16", true, "all, or those of `channels` in the preset or `--channel`; what controllers and bends say is for their own channel"},
    {"note on", "0 to 127", true, "starts a voice, or strikes the one that sounds that key already; velocity 0 is a note off"},
    {"note off", "0 to 127", true, "ends the note as the preset says; its velocity is how fast the key goes up, 64 where there is none"},
    {"velocity", "1 to 127", true, "by the preset's `velocity` curve"},
    {"key pressure", "0 to 127", true, "what the preset has `from = \"pressure\"`, in that key's voice"},
    {"channel pressure", "0 to 127", true, "the same, in all voices of the channel"},
    {"pitch bend", "14 bits", true, "its channel's voices, as far as RPN 0 says: 2 semitones, 48 on members of an MPE zone"},
    {"bank select", "CC 0, 32", true, "128 programs more for each; 0 at first"},
    {"program change", "0 to 127", true, "loads the preset of that place in the list that `models` prints; what rings goes on until it is quiet, or the next is loaded"},
    {"portamento time", "CC 5", true, "instead of the preset's `glide_s`: 4 s times the square of the share of 127"},
    {"data entry", "CC 6, 38", true, "of the registered parameter"},
    {"volume", "CC 7", true, "40 dB a decade, 100 at first; in 20 ms, without a step"},
    {"pan", "CC 10", true, "of outputs with odd numbers to those with even ones, at equal power, the middle as it is; in 20 ms, without a step; one output alone stays"},
    {"expression", "CC 11", true, "40 dB a decade, 127 at first; in 20 ms, without a step"},
    {"sustain pedal", "CC 64", true, "down from 64 on"},
    {"portamento", "CC 65", true, "from 64 on pitches glide, below they do not, whatever the preset says"},
    {"sostenuto pedal", "CC 66", true, "from 64 on holds the keys that are down as it goes down"},
    {"soft pedal", "CC 67", true, "what is struck while it is down sounds as at three quarters of its velocity"},
    {"legato switch", "CC 68", true, "from 64 on a channel that plays mono is not struck again while a key is down"},
    {"data increment, decrement", "CC 96, 97", true, "of the registered parameter, by its smallest step"},
    {"NRPN", "CC 98, 99", false, "data after it goes nowhere"},
    {"RPN", "CC 100, 101", true, "the registered parameter that data is for; 127 and 127: none"},
    {"RPN bend range", "0", true, "semitones, and cents; said to one member of an MPE zone it is for all"},
    {"RPN fine tuning", "1", true, "of the channel, a semitone down to one up"},
    {"RPN coarse tuning", "2", true, "of the channel, in semitones from 64"},
    {"RPN tuning program, bank", "3, 4", false, "there is one tuning, which the tuning messages of every number change"},
    {"RPN modulation depth range", "5", true, "how far the wheel, CC 1, goes of what the preset has for it: semitones and 128ths, and 64 of these, as at first, are all of it; less is as much less, and more is there sooner"},
    {"RPN MPE configuration", "6", true, "on channel 1 or 16: how many members the lower or the upper zone has, 0 ends it; of two that overlap the newer one has the channels. All notes there end"},
    {"other controllers", "CC 1 to 119", true, "what the preset has `from = \"cc1\"` and so on; parameters are turned for all voices, inputs move in those of the channel"},
    {"all sound off", "CC 120", true, "silence on the channel at once"},
    {"reset all controllers", "CC 121", true, "by RP-015: bend, modulation, expression, pedals and portamento as at first; volume, pan, program, tuning, ranges and zones stay"},
    {"local control", "CC 122", false, ""},
    {"all notes off", "CC 123 to 125", true, "lets the channel's keys go, as fingers would: pedals hold"},
    {"mono, poly", "CC 126, 127", true, "one voice or many on the channel, whatever the preset's `play` says; lets its keys go"},
    {"MPE", "", true, "a zone's master, channel 1 or 16, bends, turns and holds all of it, on top of what each member says. A note that was let go hears the master alone"},
    {"SysEx tuning change", "F0 7F id 08 02", true, "MIDI Tuning Standard, in real time: keys to a pitch, what sounds too; any device, any number"},
    {"SysEx tuning dump", "F0 7E id 08 01", true, "all 128 keys, for the notes that come"},
    {"SysEx octave tuning", "F0 7F id 08 08, 08 09", true, "cents of the twelve keys of every octave, in one byte or two; what sounds, too; with 7E for the notes that come; there is one tuning, for whatever channels"},
    {"other SysEx", "", false, ""},
    {"system common, real time", "", false, "neither clock nor song position"},
};
// clang-format on

}  // namespace

std::span<const MidiChartRow> midi_chart() {
  return rows;
}

}  // namespace ressort::realtime
