// app: the program's whole file system. Reads and writes text and WAV, knows where the models
// and presets are.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/result.h"

namespace ressort {

// A whole text file of at most `max_bytes`. The error says what is in the way: missing, a
// directory, too large, unreadable.
Result<std::string> read_text(const std::string& path, std::size_t max_bytes);

// Replaces what was there.
Result<Done> write_text(const std::string& path, const std::string& text);

enum class SampleFormat { float32, float64, pcm24 };

// Channels of equal length, in full precision.
struct Sound {
  double rate_hz = 44100.0;
  std::vector<std::vector<double>> channels;
};

Result<Sound> read_wav(const std::string& path);

// Writes as it goes; the file is complete after close() or destruction.
class WavWriter {
 public:
  // Refuses to write over a model or a preset.
  static Result<WavWriter> open(const std::string& path, double rate_hz, int channels,
                                SampleFormat format);
  WavWriter(WavWriter&&) noexcept;
  WavWriter& operator=(WavWriter&&) noexcept;
  ~WavWriter();

  Result<Done> write(const double* interleaved, std::size_t frames);
  Result<Done> write(const float* interleaved, std::size_t frames);
  Result<Done> close();

 private:
  struct File;
  explicit WavWriter(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

// The file that a person means by `name`: a path, with or without its ending, or the name of a
// preset or a model that came with the program. Presets go before models.
Result<std::string> find_scene(const std::string& name);

// All presets and models that came with the program, by name, sorted.
std::vector<std::string> known_presets();
std::vector<std::string> known_models();

// The folder where the program's own models are; the presets are beside it.
std::string models_folder();

}  // namespace ressort
