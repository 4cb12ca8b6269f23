// app/session: reads and writes sound files block by block.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/new_file.h"
#include "core/result.h"

namespace ressort::session {

enum class SampleFormat { float32, float64, pcm24 };

// Returns the file endings that can be written: ".wav" and others.
const std::vector<std::string_view>& sound_endings();

class SoundReader {
 public:
  // Opens a regular file in any format of libsndfile.
  static Result<SoundReader> open(const std::string& path);
  SoundReader(SoundReader&&) noexcept;
  SoundReader& operator=(SoundReader&&) noexcept;
  ~SoundReader();

  double rate_hz() const;
  std::size_t channels() const;
  long long frames() const;  // length from the header; negative: unknown
  // Reads the next frames, interleaved. Returns their number, which is smaller at the end.
  std::size_t read(double* interleaved, std::size_t frames);

 private:
  struct File;
  explicit SoundReader(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

// A sound in memory. All channels have one length; 1 is full scale.
struct Sound {
  double rate_hz = 44100.0;
  std::vector<std::vector<double>> channels;
  std::size_t frames() const { return channels.empty() ? 0 : channels[0].size(); }
};
Result<Sound> read_sound(const std::string& path);

struct SoundForm {
  double rate_hz = 44100.0;
  int channels = 2;
  std::optional<SampleFormat> samples = {};        // required format
  SampleFormat preferred = SampleFormat::float32;  // otherwise, if the file type supports it
  std::optional<long long> frames = {};            // expected number, if it is known
  bool is_shown = false;                           // see NewFile
};

// Writes a sound file. After a crash, the file is complete up to the last second.
class SoundWriter {
 public:
  // Opens a file for writing; the ending selects the type. Overwrites only sound files and empty
  // files. A .wav of more than 4 GB becomes RF64.
  static Result<SoundWriter> open(const std::string& path, const SoundForm& form,
                                  Existing existing);
  SoundWriter(SoundWriter&&) noexcept;
  SoundWriter& operator=(SoundWriter&&) noexcept;
  ~SoundWriter();  // deletes the file unless it was closed

  Result<Done> write(const double* interleaved, std::size_t frames);
  Result<Done> write(const float* interleaved, std::size_t frames);
  // Completes the file and gives it its name, or deletes it after an error.
  Result<Done> close();
  // Keeps the file after a failed write, up to that write.
  Result<Done> salvage();

 private:
  struct File;
  explicit SoundWriter(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

}  // namespace ressort::session
