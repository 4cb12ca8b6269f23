#include "app/realtime/midi_chart.h"

namespace ressort::realtime {
namespace {

// clang-format off
constexpr MidiChartRow rows[] = {
    {"channels", "1 to 16", true, "those of the preset's `channels` or `--channel`; controllers and bends act on their own channel"},
    {"note on", "0 to 127", true, "starts a voice, or strikes the voice that already plays that key; velocity 0 is a note off"},
    {"note off", "0 to 127", true, "ends the note; the velocity is the release speed. 0 means 64 until the source has sent another speed than 0 and 64 on that channel, because many senders send only 0"},
    {"velocity", "1 to 127", true, "follows the preset's `velocity` curve"},
    {"key pressure", "0 to 127", true, "controls with `from = \"pressure\"`, in the voice of that key"},
    {"channel pressure", "0 to 127", true, "controls with `from = \"pressure\"`, in all voices of the channel"},
    {"pitch bend", "14 bits", true, "bends the channel's voices; range by RPN 0, default 2 semitones, 48 on member channels of an MPE zone"},
    {"bank select", "CC 0, 32", true, "adds 128 programs per bank; default 0"},
    {"program change", "0 to 127", true, "loads the preset with that number in the list of `models`; sounding notes ring on"},
    {"portamento time", "CC 5", true, "overrides the preset's `glide_s`: 4 s times (value/127) squared"},
    {"data entry", "CC 6, 38", true, "value of the selected RPN"},
    {"volume", "CC 7", true, "40 dB per decade, default 100; smoothed over 20 ms"},
    {"pan", "CC 10", true, "balances odd and even outputs at equal power; smoothed over 20 ms"},
    {"expression", "CC 11", true, "40 dB per decade, default 127; smoothed over 20 ms"},
    {"sustain pedal", "CC 64", true, "down from 64 on; from 32 to 63 the dampers lie lightly (half-pedalling)"},
    {"portamento", "CC 65", true, "64 and above: pitches glide; overrides the preset"},
    {"sostenuto pedal", "CC 66", true, "64 and above holds the keys that are down at that moment"},
    {"soft pedal", "CC 67", true, "notes struck while it is down have three quarters of their velocity"},
    {"legato switch", "CC 68", true, "64 and above: a mono channel is not struck again while a key is down"},
    {"data increment, decrement", "CC 96, 97", true, "changes the selected RPN by its smallest step"},
    {"NRPN", "CC 98, 99", true, "selects the number of a mapping of controllers; data for other numbers are ignored"},
    {"RPN", "CC 100, 101", true, "selects the registered parameter; 127 and 127 selects none"},
    {"RPN bend range", "0", true, "semitones and cents; applies to all members of an MPE zone"},
    {"RPN fine tuning", "1", true, "of the channel, -1 to 1 semitone"},
    {"RPN coarse tuning", "2", true, "of the channel, semitones from 64"},
    {"RPN tuning program, bank", "3, 4", false, "tuning messages of any number change the one tuning"},
    {"RPN modulation depth range", "5", true, "range of the wheel, CC 1; 64/128 (the default) is the preset's, less limits it, more reaches the end sooner"},
    {"RPN MPE configuration", "6", true, "on channel 1 or 16: number of member channels of the lower or upper zone; 0 ends the zone. A newer zone takes channels from an older one. Their notes end"},
    {"other controllers", "CC 1 to 119", true, "controls with `from = \"cc1\"` and so on; parameters change for all voices, inputs in those of the channel"},
    {"all sound off", "CC 120", true, "silences the channel at once"},
    {"reset all controllers", "CC 121", true, "by RP-015: resets bend, modulation, expression, pedals and portamento; keeps volume, pan, program, tuning, ranges and zones"},
    {"local control", "CC 122", false, ""},
    {"all notes off", "CC 123 to 125", true, "releases the channel's keys; pedals still hold notes"},
    {"mono, poly", "CC 126, 127", true, "one voice or many on the channel; overrides the preset's `play`; releases the channel's keys"},
    {"MPE", "", true, "the master channel of a zone, 1 or 16, bends, controls and holds all of its notes, in addition to each member's own messages. A released note follows only the master. Member channels ignore pedals, switches (CC 64 to 69) and channel modes (CC 120 to 127)"},
    {"SysEx tuning change", "F0 7F id 08 02, 08 07", true, "sets the pitch of keys, also of sounding notes; 7E id 08 07 only of new notes; any device and program number"},
    {"SysEx tuning dump", "F0 7E id 08 01, 08 04", true, "all 128 keys, for new notes"},
    {"SysEx octave tuning", "F0 7F id 08 08, 08 09", true, "cents of the twelve keys of every octave; also for sounding notes, with 7E only for new notes; on all channels"},
    {"other SysEx", "", false, ""},
    {"timing clock", "F8", true, "24 in a beat: sets the rate of LFOs in beats, and the tempo of a song that follows the clock"},
    {"start, continue, stop", "FA to FC", true, "of a song that follows the clock; it starts at the next tick"},
    {"song position", "F2", true, "of a song that follows the clock, in sixteenth notes"},
    {"other system common, real time", "", false, ""},
};
// clang-format on

}  // namespace

std::span<const MidiChartRow> midi_chart() {
  return rows;
}

}  // namespace ressort::realtime
