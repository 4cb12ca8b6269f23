#include "app/commands/body/recording.h"

#include <algorithm>
#include <cstdio>

#include "app/commands/body/body.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/sound_file.h"
#include "app/text.h"
#include "core/identification/identify.h"

namespace ressort::commands {
namespace {

constexpr double longest_read_s = 60.0;

// Reads at most a minute; sets `was_longer` if there is more.
Result<Recording> read_recording(const std::string& path, bool& was_longer) {
  auto file = SoundReader::open(path);
  if (!file) {
    return file.error();
  }
  constexpr std::size_t block_frames = 4096;
  const std::size_t channels = file->channels();
  Recording recording{.rate_hz = file->rate_hz(), .channels = {}};
  recording.channels.resize(channels);
  const auto most = static_cast<std::size_t>(longest_read_s * recording.rate_hz);
  std::vector<double> block(channels * block_frames);
  while (const std::size_t got = file->read(block.data(), block_frames)) {
    const std::size_t room = most - recording.channels[0].size();
    was_longer = got > room;
    for (std::size_t i = 0; i < std::min(got, room) * channels; ++i) {
      recording.channels[i % channels].push_back(block[i]);
    }
    if (was_longer) {
      break;
    }
  }
  return recording;
}

}  // namespace

Result<Identification> identify_recordings(std::span<const std::string> paths,
                                           const IdentifyOptions& options,
                                           const Progress& progress) {
  bool was_longer = false;
  std::vector<Recording> recordings;
  for (const std::string& path : paths) {
    auto recording = read_recording(path, was_longer);
    if (!recording) {
      return recording.error();
    }
    if (!recordings.empty() && (recording->rate_hz != recordings[0].rate_hz ||
                                recording->channels.size() != recordings[0].channels.size())) {
      return Error{"'" + path + "' has another sample rate or number of channels than '" +
                   paths[0] + "'; convert it first"};
    }
    recordings.push_back(*std::move(recording));
  }
  auto found = identify_together(recordings, options, progress);
  if (!found) {
    return Error{"'" + joined(paths, "', '") + "': " + found.error().message +
                 (was_longer ? " in its first " + fixed(longest_read_s, 0) + " s" : "")};
  }
  if (was_longer) {
    found->warnings.push_back("only the first " + fixed(longest_read_s, 0) + " s are used");
  }
  return found;
}

int recording_body(const BodyOptions& options) {
  std::vector<std::string> read = {options.input};
  read.insert(read.end(), options.others.begin(), options.others.end());
  for (const std::string& written : {options.output, options.picture}) {
    if (auto spared = check_not_input(written, read); !spared) {
      return reject(spared.error().message);
    }
  }
  if (!options.picture.empty() && !options.picture.ends_with(".svg")) {
    return reject("--picture: expected a file that ends in .svg, found '" + options.picture + "'");
  }
  if (auto found = plot::check_gnuplot(); !options.picture.empty() && !found) {
    return reject(options.picture + ": " + found.error().message);
  }
  const Progress progress = report_stages(options.input);
  const auto found =
      identify_recordings(read,
                          {.most_modes = options.modes.value_or(IdentifyOptions().most_modes),
                           .least_modes = options.modes.value_or(0),
                           .floor_db = options.floor_db},
                          progress);
  if (!found) {
    return reject(found.error().message);
  }
  for (const std::string& warning : found->warnings) {
    std::fprintf(stderr, "%s: warning: %s\n", options.input.c_str(), warning.c_str());
  }
  const std::string source = options.input.substr(options.input.rfind('/') + 1);
  const std::vector<NoiseBand> noise = noise_bands(*found);
  if (!options.picture.empty()) {
    const RecordingParts parts = parts_of(*found, noise);
    if (const int code =
            put_figure(options.picture, recording_figure(*found, parts, source), options.force)) {
      return code;
    }
  }
  if (!options.listen.empty()) {
    if (auto written = write_parts(options.listen, parts_of(*found, noise), options.force);
        !written) {
      return reject("--listen: " + written.error().message);
    }
  }
  const std::string label = label_of_file(options.output.empty() ? options.input : options.output);
  std::string model = body_model(*found, label, source, options.mass);
  if (options.output.ends_with(".toml")) {
    const std::string file = options.output.substr(0, options.output.size() - 5) + ".mdl";
    const std::string preset =
        played_preset(*found, noise, label, file.substr(file.rfind('/') + 1), source);
    model = played_model(*found, noise, label, source, options.mass);
    if (const int code = write_output(file, model, options.force)) {
      return code;
    }
    if (const int code = write_output(options.output, preset, options.force)) {
      return code;
    }
  } else if (!options.output.empty()) {
    if (const int code = write_output(options.output, model, options.force)) {
      return code;
    }
  }
  if (options.as_json) {
    std::fputs(identification_json(*found, options.mass).c_str(), stdout);
  } else if (options.output.empty()) {
    std::fputs(model.c_str(), stdout);
  } else {
    const double lowest_hz = found->modes.front().frequency_hz.value;
    const double highest_hz = found->modes.back().frequency_hz.value;
    const std::string where = found->modes.size() == 1
                                  ? "at " + fixed(lowest_hz, 1)
                                  : "from " + fixed(lowest_hz, 1) + " to " + fixed(highest_hz, 1);
    std::printf("%s: %s %s Hz, residual %s dB\n", options.output.c_str(),
                counted(found->modes.size(), "mode", "modes").c_str(), where.c_str(),
                fixed(found->residual_db, 1).c_str());
    std::fputs(choices_of(*found, "", "\n").c_str(), stdout);
  }
  return exit_code::done;
}

}  // namespace ressort::commands
