// app/commands: the modes in a recording, as a model, as JSON and as a figure.
#pragma once

#include <span>
#include <string>

#include "app/commands/gallery/sound.h"
#include "app/plot/plot.h"
#include "core/identification/identify.h"
#include "core/identification/noise_bands.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::commands {

// Finds the modes of one object in the first minute of each sound file; warns if one is longer.
// Errors have the file name. Blocks. [any thread but audio]
Result<Identification> identify_recordings(std::span<const std::string> paths,
                                           const IdentifyOptions& options,
                                           const Progress& progress);

// Makes a label of a file name, from its letters, digits and _; "body" if none is left.
std::string label_of_file(const std::string& path);

// Returns a model of a body with the struck places and one place per channel (`mic`, `left` and
// `right`, or `mic1` and so on), its modes with their standard deviations, a force input, and a
// position output per channel.
std::string body_model(const Identification& found, const std::string& label,
                       const std::string& source, double mass);

// Return a model of a body with knobs and of a second body with one input for each band of noise,
// and a preset that plays this model: keys strike it and play the noise.
std::string played_model(const Identification& found, const std::vector<NoiseBand>& noise,
                         const std::string& label, const std::string& source, double mass);
std::string played_preset(const Identification& found, const std::vector<NoiseBand>& noise,
                          const std::string& label, const std::string& model,
                          const std::string& source);

// Returns the names of the struck places: `hit`, or `hit1` and so on if there are several
// recordings.
std::vector<std::string> struck_places(const Identification& found);
// Returns the displacement of a mode at the place of a recording, relative to the described one.
double hit_of(const Identification& found, std::size_t recording, std::size_t mode);

// Returns the residuals that fewer or more modes would leave, as a sentence, or nothing.
std::string choices_of(const Identification& found, const std::string& before,
                       const std::string& after);

// Returns modes, residual and warnings as one JSON object.
std::string identification_json(const Identification& found, double mass);

// The analysed part of a recording, as recorded, and the parts of the body that plays it.
struct RecordingParts {
  Sound recording;
  Sound modes;
  Sound noise;
  Sound sum;       // modes and noise
  Sound residual;  // recording without modes
};
RecordingParts parts_of(const Identification& found, const std::vector<NoiseBand>& noise);

// Writes recording.wav, modes.wav, noise.wav and sum.wav at equal loudness (ITU-R BS.1770), the
// highest peak at -0.9 dBFS. Makes the folder. [main]
Result<Done> write_parts(const std::string& folder, RecordingParts parts, bool force);

// Two rows of panels: the spectrograms of the recording, of the body and of what its modes leave;
// then the spectrum of the recording with the peak of each mode, the T60 of each mode with its
// standard deviation, and the spectrum of the residual.
plot::Figure recording_figure(const Identification& found, const RecordingParts& parts,
                              const std::string& title);

}  // namespace ressort::commands
