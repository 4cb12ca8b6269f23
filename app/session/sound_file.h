// app/session: sound files, read and written block by block.
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

// ".wav" and the other endings of sound files that can be written.
const std::vector<std::string_view>& sound_endings();

class SoundReader {
 public:
  // An ordinary file in any form that libsndfile knows.
  static Result<SoundReader> open(const std::string& path);
  SoundReader(SoundReader&&) noexcept;
  SoundReader& operator=(SoundReader&&) noexcept;
  ~SoundReader();

  double rate_hz() const;
  std::size_t channels() const;
  long long frames() const;  // as the file says; negative: it does not
  // The next frames, interleaved; how many there were. Fewer at the end.
  std::size_t read(double* interleaved, std::size_t frames);

 private:
  struct File;
  explicit SoundReader(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

// A whole sound in memory: channels of one length; 1 is full scale.
struct Sound {
  double rate_hz = 44100.0;
  std::vector<std::vector<double>> channels;
  std::size_t frames() const { return channels.empty() ? 0 : channels[0].size(); }
};
Result<Sound> read_sound(const std::string& path);

struct SoundForm {
  double rate_hz = 44100.0;
  int channels = 2;
  std::optional<SampleFormat> samples = {};        // these and no others
  SampleFormat preferred = SampleFormat::float32;  // otherwise, where the file can hold them
  std::optional<long long> frames = {};            // as many as will come, where that is known
  bool is_shown = false;                           // as a NewFile's
};

// Writes as it goes. What is killed is found as long as it was a second before.
class SoundWriter {
 public:
  // The ending chooses the form. What can be replaced is a sound or empty, never another file. A
  // .wav of more than 4 GB becomes RF64.
  static Result<SoundWriter> open(const std::string& path, const SoundForm& form,
                                  Existing existing);
  SoundWriter(SoundWriter&&) noexcept;
  SoundWriter& operator=(SoundWriter&&) noexcept;
  ~SoundWriter();  // what was not closed is gone

  Result<Done> write(const double* interleaved, std::size_t frames);
  Result<Done> write(const float* interleaved, std::size_t frames);
  // The file is complete and takes its name; or there is an error, and none.
  Result<Done> close();
  // After a write that failed: what came before it takes the name.
  Result<Done> salvage();

 private:
  struct File;
  explicit SoundWriter(std::unique_ptr<File> file);
  std::unique_ptr<File> file_;
};

}  // namespace ressort::session
