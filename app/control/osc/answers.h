// app/control: OSC replies to the queries of the registry. [OSC's thread]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::answer {

// Replies /param/NAME f:value for every parameter that matches.
void parameters(const Question& question);

// Replies /param/NAME/range f:minimum f:maximum f:lowest f:highest; the last two are the stable
// range, infinite if unlimited.
void ranges(const Question& question);

// Reply /done s:address [ID], or /fail s:address [ID] s:reason, later from the session's worker.
void load(const Question& question);
void save(const Question& question);
void flight(const Question& question);

// Replies /status.reply with the figures of status.h.
void status(const Question& question);

// Replies a row /describe.reply s:address s:arguments s:meaning for everything, then /describe.end
// i:rows, so that the client can detect lost rows. A parameter's row adds floats: its value,
// minimum, maximum, and its stable range.
void describe(const Question& question);

// Reply a row /models.reply s:name, or /presets.reply s:name s:description, for each, then
// /models.end i:rows or /presets.end i:rows.
void models(const Question& question);
void presets(const Question& question);

// Replies a row /modes.reply i:number f:frequency f:t60 f:level... for each mode, levels input by
// input, then /modes.end i:rows, later from the session's worker.
void modes(const Question& question);
// Replies /done s:address, or /fail s:address s:reason, later from the session's worker.
void tune(const Question& question);

// Replies /done s:address [s:figure f:reached f:error]... [s:reason]..., errors in just noticeable
// differences, or /fail s:address s:reason, later from the session's worker.
void shape(const Question& question);

// Reply /subscribe.reply f:seconds, followed by the messages of Subscribers, or /done s:address, or
// an error.
void subscribe(const Question& question);
void unsubscribe(const Question& question);

// Replies /timbre.reply f:seconds, and then the messages of Subscribers.
void timbre(const Question& question);

}  // namespace ressort::control::answer
