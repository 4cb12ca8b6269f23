// app/session: from a name to what can be compiled: finds the files, reads the texts.
#pragma once

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

// Something to say about a file.
struct Finding {
  std::string file;
  Diagnostic diagnostic;  // line 0: about the file as a whole
  std::string source;     // the line itself; empty where there is none
};

struct Scene;

// A text that a scene was read from, or one that it would be read from if it were there.
struct SceneFile {
  std::string path;
  std::string text;
  bool is_there = true;
};

// An error at a place of the text that is all of `file`.
Finding finding_of(const std::string& file, std::string_view text, const Error& error);

// An error in the model, at its line of the file that it comes from. Blocks on the disk.
Finding finding_in_model(const Scene& scene, const Error& error);

// "file:line:column: error: message".
std::string to_string(const Finding& finding);

// The same, and under it the line with the place marked, for a terminal.
std::string with_source(const Finding& finding);

// What is said of keys goes before what the preset says.
struct KeyOptions {
  std::string scale;                 // a Scala file's path; empty: the preset's
  std::string keyboard_map;          // the same
  std::optional<double> a4_hz;       // to which all is tuned
  std::optional<unsigned> channels;  // a bit for each MIDI channel that is listened to
};

// The frequencies of all keys, or what is wrong with a file.
struct TuningReading {
  std::vector<double> keys_hz;  // [key]
  std::optional<Finding> failure;
};

// Of a scale and a keyboard map; the path of one of them may be empty: twelve equal semitones, or
// every key a step from the middle C on. Blocks on the disk. [any thread but audio]
TuningReading read_tuning(const std::string& scale, const std::string& keyboard_map);

struct SceneOptions {
  bool bare = false;                   // the model without a preset: the network alone
  std::optional<ThirdArgument> third;  // whatever preset and model say
  Reach reach = Reach::any_file;       // of the name, and of the preset's model
  KeyOptions keys = {};
  const std::vector<SceneFile>* files = nullptr;  // instead of those on the disk; by their paths
  std::uint64_t most_nodes = max_macro_nodes;     // that a model's macros may have
  bool is_stop = false;                           // of a preset's morph, which has none itself
  Progress progress = {};                         // a reading that it stops fails with `stopped`
};

// Where a file's lines stand in the text that its model was read from.
struct ModelText {
  std::string path;
  int first_line = 1;
};

struct Scene {
  std::string name;  // "PolyTriangle", for people
  std::string path;  // of the file that was asked for
  std::string model_path;
  std::vector<ModelText> texts;  // the model's, and those that its preset reads with it
  Network network;
  Preset preset;
  std::string preset_text;             // what it was read from; empty: it was made up
  bool has_preset = false;             // read from a file, not made up
  std::optional<ThirdArgument> third;  // what the third state argument means, if that matters
  std::string motion;                  // the same for a person, and why
  std::vector<std::string> warnings;   // "file:line:column: warning: ..."
};

// What came of a name: a scene unless a finding is an error.
struct Reading {
  std::optional<Scene> scene;
  std::vector<Finding> findings;
  std::vector<SceneFile> files;
};

// What was told of files, for who may not read them: of what has a place in one, the file's name,
// line and column and what is wrong, without a word of the text.
std::string without_source(std::string_view message);

// The line that a known preset says of itself; empty where it cannot be read.
std::string preset_description(const std::string& name);

// Finds and reads a model or a preset with its model; goes on after an error in the model, so that
// every problem is told at once. Without a preset the model gets a default one, `bare` or
// playable. Blocks on the disk. [any thread but audio]
Reading read_scene(const std::string& name, const SceneOptions& options);

// The same for who wants the scene or nothing, of a Reading. The error's message is all findings,
// one a line.
Result<Scene> scene_of(Reading&& reading);
Result<Scene> load_scene(const std::string& name, const SceneOptions& options);

}  // namespace ressort::session
