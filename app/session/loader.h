// app/session: reads scenes: finds the files of a model or preset and parses them.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/files.h"
#include "core/model/language/mdl.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::session {

// A message about a file.
struct Finding {
  std::string file;
  Diagnostic diagnostic;  // line 0: the file as a whole
  std::string source;     // text of the line; empty if there is none
};

struct Scene;

// A file of a scene, or one that the scene would use if it existed.
struct SceneFile {
  std::string path;
  std::string text;
  bool is_there = true;
};

// Makes a finding from an error in the file that contains `text`.
Finding finding_of(const std::string& file, std::string_view text, const Error& error);

// Makes a finding from an error in a model's file. Blocks on the disk.
Finding finding_in_file(const std::string& path, const Error& error);

// Makes a finding from an error in the model, with the file that its line comes from. Blocks on the
// disk.
Finding finding_in_model(const Scene& scene, const Error& error);

// Returns "file:line:column: error: message".
std::string to_string(const Finding& finding);

// The same, followed by the source line with the position marked, for a terminal.
std::string with_source(const Finding& finding);

// Tuning options that override the preset.
struct KeyOptions {
  // [channel of a MIDI file] channel that its messages play on; -1: they are left out.
  using SongChannels = std::array<int, 16>;
  std::string scale;                 // path of a Scala file; empty: the preset's
  std::string keyboard_map;          // the same for a keyboard map
  std::optional<double> a4_hz;       // frequency of A4
  int transpose = 0;                 // semitones, added to the preset's
  std::optional<unsigned> channels;  // bit mask of the received MIDI channels
  std::optional<SongChannels> song_channels = {};
};

// The frequencies of all keys, or the error.
struct TuningReading {
  std::vector<double> keys_hz;  // [key]
  std::optional<Finding> failure;
};

// Reads a scale and a keyboard map. Either path may be empty: twelve equal semitones, and one step
// per key from middle C. Blocks on the disk. [any thread but audio]
TuningReading read_tuning(const std::string& scale, const std::string& keyboard_map);

struct SceneOptions {
  bool bare = false;                   // the model without a preset and without a generated one
  std::optional<ThirdArgument> third;  // overrides preset and model
  Reach reach = Reach::any_file;       // reach of the name and of the preset's model
  KeyOptions keys = {};
  const std::vector<SceneFile>* files = nullptr;  // used instead of the disk, by their paths
  std::uint64_t most_nodes = max_macro_nodes;     // limit for the model's macros
  bool is_stop = false;    // the scene is a stop of a preset's morph and has no morph itself
  Progress progress = {};  // a stopped reading fails with `stopped`
};

// The first line of a file in the joined text of a model.
struct ModelText {
  std::string path;
  int first_line = 1;
};

struct Scene {
  std::string name;  // name for messages: "PolyTriangle"
  std::string path;  // path of the requested file
  std::string model_path;
  std::vector<ModelText> texts;  // files of the model
  Network network;
  Preset preset;
  std::string preset_text;             // empty if the preset was generated
  bool has_preset = false;             // false if the preset was generated
  std::optional<ThirdArgument> third;  // meaning of the third state argument, if it matters
  std::string motion;                  // the same with the reason, for people
  std::vector<std::string> warnings;   // "file:line:column: warning: ..."
};

// The result of reading: a scene, unless a finding is an error.
struct Reading {
  std::optional<Scene> scene;
  std::vector<Finding> findings;
  std::vector<SceneFile> files;
};

// Removes quotations of source text from messages for readers who may not see the files: keeps the
// file name, line, column and the problem.
std::string without_source(std::string_view message);

// Returns a preset's one-line description; empty if it cannot be read.
std::string preset_description(const std::string& name);

// Finds and reads a model, or a preset with its model. Continues after an error in the model to
// report all errors at once. A model without a preset gets a generated one, for playing or `bare`.
// Blocks on the disk. [any thread but audio]
Reading read_scene(const std::string& name, const SceneOptions& options);

// Returns the scene of a reading, or an error with all findings, one a line.
Result<Scene> scene_of(Reading&& reading);
Result<Scene> load_scene(const std::string& name, const SceneOptions& options);

}  // namespace ressort::session
