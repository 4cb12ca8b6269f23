// app/control: OSC replies to the queries of the registry. [OSC's thread]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::answer {

// Replies /param/NAME f:value for every parameter that matches.
void parameters(const Query& query);
void knobs(const Query& query);

// Replies /param/NAME/range f:minimum f:maximum f:lowest f:highest; the last two are the stable
// range, infinite if unlimited.
void ranges(const Query& query);

// Reply /done s:address [ID], or /fail s:address [ID] s:reason, later from the session's worker.
void load(const Query& query);
void next_preset(const Query& query);
void previous_preset(const Query& query);
void save(const Query& query);
void flight(const Query& query);

// Reply /done s:address s:target, or /fail s:address s:reason.
void learn(const Query& query);
void unlearn(const Query& query);

// Replies /status.reply with the figures of status.h.
void status(const Query& query);

// Replies a row /describe.reply s:address s:arguments s:meaning for everything, then /describe.end
// i:rows, so that the client can detect lost rows. A parameter's row adds floats: its value,
// minimum, maximum, and its stable range.
void describe(const Query& query);

// Reply a row /models.reply s:name, or /presets.reply s:name s:description, for each, then
// /models.end i:rows or /presets.end i:rows.
void models(const Query& query);
void presets(const Query& query);

// Replies a row /modes.reply i:number f:frequency f:t60 f:level... for each mode, levels input by
// input, then /modes.end i:rows, later from the session's worker.
void modes(const Query& query);
// Replies /done s:address, or /fail s:address s:reason, later from the session's worker.
void tune(const Query& query);

// Replies /done s:address [s:figure f:reached f:error]... [s:reason]..., errors in just noticeable
// differences, or /fail s:address s:reason, later from the session's worker.
void shape(const Query& query);

// Reply /subscribe.reply f:seconds, followed by the messages of Subscribers, or /done s:address, or
// an error.
void subscribe(const Query& query);
void unsubscribe(const Query& query);

// Replies /done s:address s:description, or /fail s:address s:reason.
void song(const Query& query);

// Replies /timbre.reply f:seconds, and then the messages of Subscribers.
void timbre(const Query& query);

}  // namespace ressort::control::answer
