// app/control: what the questions of the registry are answered by OSC. [OSC's thread]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::answer {

// /param/NAME f:value of every parameter that fits
void parameters(const Question& question);

// /param/NAME/range f:minimum f:maximum f:lowest f:highest that is stable, infinite where nothing
// limits
void ranges(const Question& question);

// /done s:address [ID], or /fail s:address [ID] s:why; later, on the session's worker
void load(const Question& question);
void save(const Question& question);
void flight(const Question& question);

// /status.reply, as status.h lists it
void status(const Question& question);

// A row /describe.reply s:address s:arguments s:meaning for everything, then /describe.end i:rows,
// so that whoever counts knows if one was lost on the way. A parameter's row has floats after its
// meaning: its value, minimum and maximum, and between what it is stable.
void describe(const Question& question);

// A row /models.reply s:name or /presets.reply s:name s:line for each, then /models.end i:rows or
// /presets.end i:rows
void models(const Question& question);
void presets(const Question& question);

// A row /modes.reply i:number f:frequency f:t60 f:level... for each, levels input by input, then
// /modes.end i:rows; later, on the session's worker
void modes(const Question& question);
// /done s:address, or /fail s:address s:why; later, on the session's worker
void tune(const Question& question);

// /done s:address [s:figure f:reached f:off]... [s:why]..., off in just noticeable differences, or
// /fail s:address s:why; later, on the session's worker
void shape(const Question& question);

// /subscribe.reply f:seconds and, in time, what Subscribers tells; /done s:address or an error
void subscribe(const Question& question);
void unsubscribe(const Question& question);

// /timbre.reply f:seconds and, in time, what Subscribers tells
void timbre(const Question& question);

}  // namespace ressort::control::answer
