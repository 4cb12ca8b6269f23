#include "app/session/sound_file.h"

#include <sndfile.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "app/text.h"
#include "core/ranges.h"

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

struct Kind {
  std::string_view ending;
  int form;               // format number of libsndfile
  std::string_view mark;  // first bytes of a file
  bool holds_floats;
  bool ends_at_4_gb;
  bool keeps_header;  // has a header with the length, to be updated while recording
};

constexpr Kind kinds[] = {
    {".wav", SF_FORMAT_WAV, "RIFF", true, false, true},  // larger files are RF64
    {".w64", SF_FORMAT_W64, "riff", true, false, true},
    {".flac", SF_FORMAT_FLAC, "fLaC", false, false, false},
    {".ogg", SF_FORMAT_OGG, "OggS", false, false, false},
    {".aiff", SF_FORMAT_AIFF, "FORM", true, true, true},
    {".aif", SF_FORMAT_AIFF, "FORM", true, true, true},
    {".au", SF_FORMAT_AU, ".snd", true, true, true},
    {".caf", SF_FORMAT_CAF, "caff", true, false, true},
};
// size of all samples; the rest is for the header
constexpr double most_bytes = 4294967295.0 - 1048576.0;
constexpr std::chrono::milliseconds header_age{500};  // interval of header updates

const Kind* kind_of(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  std::ranges::transform(ending, ending.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  });
  const auto found = std::ranges::find(kinds, ending, &Kind::ending);
  return found == std::end(kinds) ? nullptr : &*found;
}

// Returns true for an empty file or a sound file, complete or not.
bool may_be_replaced(const std::string& path) {
  char first[4] = {};
  std::ifstream file(path, std::ios::binary);
  file.read(first, sizeof first);
  const std::string_view mark(first, static_cast<std::size_t>(file.gcount()));
  return mark.empty() || mark == "RF64" ||
         std::ranges::any_of(kinds, [&](const Kind& kind) { return kind.mark == mark; });
}

int samples_of(SampleFormat format) {
  return format == SampleFormat::float32   ? SF_FORMAT_FLOAT
         : format == SampleFormat::float64 ? SF_FORMAT_DOUBLE
                                           : SF_FORMAT_PCM_24;
}

}  // namespace

const std::vector<std::string_view>& sound_endings() {
  static const std::vector<std::string_view> endings = mapped(kinds, &Kind::ending);
  return endings;
}

struct SoundReader::File {
  SNDFILE* handle = nullptr;
  SF_INFO info{};
  ~File() { sf_close(handle); }
};

SoundReader::SoundReader(std::unique_ptr<File> file) : file_(std::move(file)) {}
SoundReader::SoundReader(SoundReader&&) noexcept = default;
SoundReader& SoundReader::operator=(SoundReader&&) noexcept = default;
SoundReader::~SoundReader() = default;

Result<SoundReader> SoundReader::open(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return Error{"there is no file '" + path + "'"};
  }
  if (!fs::is_regular_file(status)) {
    return Error{"'" + path + "' is not a regular file"};
  }
  auto file = std::make_unique<File>();
  file->handle = sf_open(path.c_str(), SFM_READ, &file->info);
  if (file->handle == nullptr) {
    return Error{"'" + path + "' is not a readable sound file: " + sf_strerror(nullptr)};
  }
  return SoundReader(std::move(file));
}

double SoundReader::rate_hz() const {
  return static_cast<double>(file_->info.samplerate);
}
std::size_t SoundReader::channels() const {
  return static_cast<std::size_t>(file_->info.channels);
}
long long SoundReader::frames() const {
  return file_->info.frames == SF_COUNT_MAX ? -1 : file_->info.frames;
}
std::size_t SoundReader::read(double* interleaved, std::size_t frames) {
  return static_cast<std::size_t>(std::max<sf_count_t>(
      0, sf_readf_double(file_->handle, interleaved, static_cast<sf_count_t>(frames))));
}

namespace {

// I/O functions for libsndfile that remember the first error, also one at closing.
struct Tape {
  int descriptor = -1;
  int error = 0;  // errno of the first error

  static sf_count_t length(void* tape) {
    struct stat file {};
    return fstat(static_cast<Tape*>(tape)->descriptor, &file) == 0 ? file.st_size : -1;
  }
  static sf_count_t seek(sf_count_t offset, int whence, void* tape) {
    return lseek(static_cast<Tape*>(tape)->descriptor, offset, whence);
  }
  static sf_count_t tell(void* tape) { return seek(0, SEEK_CUR, tape); }
  static sf_count_t read(void* bytes, sf_count_t count, void* tape) {
    return ::read(static_cast<Tape*>(tape)->descriptor, bytes, static_cast<std::size_t>(count));
  }
  static sf_count_t write(const void* bytes, sf_count_t count, void* tape) {
    Tape& self = *static_cast<Tape*>(tape);
    sf_count_t done = 0;
    while (done < count) {
      const ssize_t some = ::write(self.descriptor, static_cast<const char*>(bytes) + done,
                                   static_cast<std::size_t>(count - done));
      if (some < 0 && errno == EINTR) {
        continue;
      }
      if (some <= 0) {
        self.error = self.error != 0 ? self.error : errno;
        break;
      }
      done += some;
    }
    return done;
  }
};

// libsndfile gives RF64 files a chunk of peaks with a time stamp, also if it is told not to.
// Without the stamp, the same sound gives the same file.
void clear_time_of_peaks(Tape& tape) {
  std::array<char, 256> head{};
  const ssize_t size = pread(tape.descriptor, head.data(), head.size(), 0);
  const std::string_view text(head.data(), static_cast<std::size_t>(std::max<ssize_t>(0, size)));
  const std::size_t at = text.substr(0, text.find("data")).find("PEAK");
  constexpr std::string_view none("\0\0\0\0", 4);
  constexpr std::size_t to_time = 12;  // after name, size and version
  if (at != std::string_view::npos &&
      pwrite(tape.descriptor, none.data(), none.size(), static_cast<off_t>(at + to_time)) < 0) {
    tape.error = tape.error != 0 ? tape.error : errno;
  }
}

}  // namespace

struct SoundWriter::File {
  File(std::string name, const Kind& of, NewFile place)
      : path(std::move(name)), kind(of), file(std::move(place)) {}
  ~File() {
    if (handle != nullptr) {
      sf_close(handle);
    }
  }

  std::string path;
  const Kind& kind;
  NewFile file;
  Tape tape{file.descriptor()};
  SNDFILE* handle = nullptr;
  double frame_bytes = 0.0;
  double bytes = 0.0;
  std::chrono::steady_clock::time_point header_time = std::chrono::steady_clock::now();

  Error failure() const {
    return {"writing '" + path + "' failed: " +
            (tape.error != 0 ? std::generic_category().message(tape.error)
                             : std::string(sf_strerror(handle)))};
  }

  template <class T, class Write>
  Result<Done> write(const T* samples, std::size_t frames, Write&& put) {
    bytes += frame_bytes * static_cast<double>(frames);
    if (kind.ends_at_4_gb && bytes > most_bytes) {
      return Error{"'" + path + "' is full: a " + std::string(kind.ending) + " is limited to 4 GB"};
    }
    const auto count = static_cast<sf_count_t>(frames);
    if (put(handle, samples, count) != count || tape.error != 0) {
      return failure();
    }
    const auto now = std::chrono::steady_clock::now();
    if (kind.keeps_header && now - header_time >= header_age) {
      header_time = now;
      sf_command(handle, SFC_UPDATE_HEADER_NOW, nullptr, 0);
    }
    return Done{};
  }
};

SoundWriter::SoundWriter(std::unique_ptr<File> file) : file_(std::move(file)) {}
SoundWriter::SoundWriter(SoundWriter&&) noexcept = default;
SoundWriter& SoundWriter::operator=(SoundWriter&&) noexcept = default;
SoundWriter::~SoundWriter() = default;

Result<SoundWriter> SoundWriter::open(const std::string& path, const SoundForm& form,
                                      Existing existing) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  const bool is_device = fs::is_character_file(status);
  if (fs::is_fifo(status) || fs::is_socket(status)) {
    return Error{"'" + path + "' is a pipe, but a sound file must be seekable"};
  }
  const Kind* const kind = is_device ? kinds : kind_of(path);
  if (kind == nullptr) {
    std::vector<std::string> known(sound_endings().begin(), sound_endings().end());
    return Error{"'" + path + "' has no known sound file ending; use one of " +
                 joined(known, ", ")};
  }
  const bool is_ogg = kind->form == SF_FORMAT_OGG;
  if (form.samples && (is_ogg || (!kind->holds_floats && form.samples != SampleFormat::pcm24))) {
    return Error{"'" + path + "': a " + std::string(kind->ending) + " holds " +
                 (is_ogg ? "compressed samples only" : "pcm24, but no floats") +
                 "; use .wav, .w64, .aiff, .au or .caf"};
  }
  const SampleFormat samples =
      kind->holds_floats ? form.samples.value_or(form.preferred) : SampleFormat::pcm24;
  const double frame_bytes = form.channels * (samples == SampleFormat::float64   ? 8.0
                                              : samples == SampleFormat::float32 ? 4.0
                                                                                 : 3.0);
  const bool fits = form.frames && frame_bytes * static_cast<double>(*form.frames) <= most_bytes;
  if (kind->ends_at_4_gb && form.frames && !fits) {
    return Error{"'" + path + "': a " + std::string(kind->ending) +
                 " is limited to 4 GB; use .wav, .w64, .flac or .caf"};
  }
  if (fs::is_regular_file(status) && existing == Existing::replace && !may_be_replaced(path)) {
    return Error{"'" + path + "' is not a sound file, so it is not overwritten"};
  }
  auto place = NewFile::open(path, existing, form.is_shown);
  if (!place) {
    return place.error();
  }
  auto file = std::make_unique<File>(path, *kind, *std::move(place));
  const bool may_grow = kind->form == SF_FORMAT_WAV && !fits && !is_device;
  SF_INFO info{};
  info.samplerate = static_cast<int>(std::lround(form.rate_hz));
  info.channels = form.channels;
  info.format =
      (may_grow ? SF_FORMAT_RF64 : kind->form) | (is_ogg ? SF_FORMAT_VORBIS : samples_of(samples));
  file->frame_bytes = frame_bytes;
  SF_VIRTUAL_IO callbacks{Tape::length, Tape::seek, Tape::read, Tape::write, Tape::tell};
  file->handle = sf_open_virtual(&callbacks, SFM_WRITE, &info, &file->tape);
  if (file->handle == nullptr || file->tape.error != 0) {
    return file->failure();
  }
  sf_command(file->handle, SFC_SET_CLIPPING, nullptr, SF_TRUE);
  // No peak chunk, because it has a time stamp: the same render gives the same file.
  sf_command(file->handle, SFC_SET_ADD_PEAK_CHUNK, nullptr, SF_FALSE);
  if (may_grow) {
    sf_command(file->handle, SFC_RF64_AUTO_DOWNGRADE, nullptr, SF_TRUE);
  }
  return SoundWriter(std::move(file));
}

Result<Done> SoundWriter::write(const double* interleaved, std::size_t frames) {
  return file_->write(interleaved, frames, sf_writef_double);
}

Result<Done> SoundWriter::write(const float* interleaved, std::size_t frames) {
  return file_->write(interleaved, frames, sf_writef_float);
}

Result<Done> SoundWriter::close() {
  sf_close(std::exchange(file_->handle, nullptr));
  clear_time_of_peaks(file_->tape);
  return file_->tape.error == 0 ? file_->file.keep() : file_->failure();
}

Result<Done> SoundWriter::salvage() {
  sf_close(std::exchange(file_->handle, nullptr));
  return file_->file.keep();
}

Result<Sound> read_sound(const std::string& path) {
  auto file = SoundReader::open(path);
  if (!file) {
    return file.error();
  }
  constexpr std::size_t block_frames = 4096;
  const std::size_t channels = file->channels();
  Sound sound{.rate_hz = file->rate_hz(), .channels = {}};
  sound.channels.resize(channels);
  std::vector<double> block(channels * block_frames);
  while (const std::size_t got = file->read(block.data(), block_frames)) {
    for (std::size_t i = 0; i < got * channels; ++i) {
      sound.channels[i % channels].push_back(block[i]);
    }
  }
  return sound;
}

}  // namespace ressort::session
