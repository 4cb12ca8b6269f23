#include "app/files.h"

#include <sndfile.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

namespace ressort {
namespace {

namespace fs = std::filesystem;

// The installed place or the source tree, whichever is there; RESSORT_DATA goes before both.
const fs::path& data_folder() {
  static const fs::path folder = [] {
    std::vector<fs::path> tried;
    if (const char* given = std::getenv("RESSORT_DATA")) {
      tried.emplace_back(given);
    }
    std::error_code error;
    const fs::path program = fs::read_symlink("/proc/self/exe", error);
    tried.push_back(program.parent_path().parent_path() / "share" / "ressort");
    tried.emplace_back(RESSORT_SOURCE);
    for (const fs::path& path : tried) {
      if (fs::is_directory(path / "models", error)) {
        return path;
      }
    }
    return fs::current_path(error);
  }();
  return folder;
}

std::vector<std::string> names_in(const fs::path& folder, const char* ending) {
  std::set<std::string> names;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (entry->path().extension() == ending) {
      names.insert(entry->path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

// Numbers of samples go to libsndfile in whole frames.
template <class T, class Write>
Result<Done> write_frames(SNDFILE* file, const T* samples, std::size_t frames, Write&& write) {
  if (write(file, samples, static_cast<sf_count_t>(frames)) != static_cast<sf_count_t>(frames)) {
    return Error{std::string("writing the sound failed: ") + sf_strerror(file)};
  }
  return Done{};
}

}  // namespace

Result<std::string> read_text(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return Error{"there is no file '" + path + "'"};
  }
  if (fs::is_directory(status)) {
    return Error{"'" + path + "' is a folder, not a file"};
  }
  if (!fs::is_regular_file(status)) {
    return Error{"'" + path + "' is no ordinary file"};
  }
  const auto size = fs::file_size(path, error);
  if (!error && size > max_bytes) {
    return Error{"'" + path + "' has " + std::to_string(size >> 20) + " MiB; at most " +
                 std::to_string(max_bytes >> 20) + " MiB are read"};
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(size), '\0');
  if (!file || !file.read(text.data(), static_cast<std::streamsize>(text.size()))) {
    return Error{"'" + path + "' cannot be read: " + std::strerror(errno)};
  }
  return text;
}

Result<Done> write_text(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) {
    return Error{"'" + path + "' cannot be written: " + std::strerror(errno)};
  }
  return Done{};
}

Result<Sound> read_wav(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    return Error{"there is no file '" + path + "'"};
  }
  SF_INFO info{};
  const std::unique_ptr<SNDFILE, int (*)(SNDFILE*)> file(sf_open(path.c_str(), SFM_READ, &info),
                                                         sf_close);
  if (!file) {
    return Error{"'" + path + "' is no sound file that can be read: " + sf_strerror(nullptr)};
  }
  const auto channels = static_cast<std::size_t>(info.channels);
  Sound sound{.rate_hz = static_cast<double>(info.samplerate), .channels = {}};
  sound.channels.resize(channels);
  std::vector<double> block(4096 * channels);
  for (sf_count_t got = 0; (got = sf_readf_double(file.get(), block.data(), 4096)) > 0;) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(got) * channels; ++i) {
      sound.channels[i % channels].push_back(block[i]);
    }
  }
  return sound;
}

struct WavWriter::File {
  SNDFILE* handle = nullptr;
  std::string path;
  ~File() {
    if (handle != nullptr) {
      sf_close(handle);
    }
  }
};

WavWriter::WavWriter(std::unique_ptr<File> file) : file_(std::move(file)) {}
WavWriter::WavWriter(WavWriter&&) noexcept = default;
WavWriter& WavWriter::operator=(WavWriter&&) noexcept = default;
WavWriter::~WavWriter() = default;

Result<WavWriter> WavWriter::open(const std::string& path, double rate_hz, int channels,
                                  SampleFormat format) {
  if (path.ends_with(".mdl") || path.ends_with(".toml")) {
    return Error{"'" + path + "' is the name of a model or a preset, not of a sound"};
  }
  SF_INFO info{};
  info.samplerate = static_cast<int>(std::lround(rate_hz));
  info.channels = channels;
  info.format = SF_FORMAT_WAV | (format == SampleFormat::float32   ? SF_FORMAT_FLOAT
                                 : format == SampleFormat::float64 ? SF_FORMAT_DOUBLE
                                                                   : SF_FORMAT_PCM_24);
  auto file = std::make_unique<File>();
  file->path = path;
  file->handle = sf_open(path.c_str(), SFM_WRITE, &info);
  if (file->handle == nullptr) {
    return Error{"'" + path + "' cannot be written: " + sf_strerror(nullptr)};
  }
  sf_command(file->handle, SFC_SET_CLIPPING, nullptr, SF_TRUE);
  // No peak chunk: it holds the time of day, and the same render shall give the same file.
  sf_command(file->handle, SFC_SET_ADD_PEAK_CHUNK, nullptr, SF_FALSE);
  return WavWriter(std::move(file));
}

Result<Done> WavWriter::write(const double* interleaved, std::size_t frames) {
  return write_frames(file_->handle, interleaved, frames, sf_writef_double);
}

Result<Done> WavWriter::write(const float* interleaved, std::size_t frames) {
  return write_frames(file_->handle, interleaved, frames, sf_writef_float);
}

Result<Done> WavWriter::close() {
  const int failure = sf_close(file_->handle);
  file_->handle = nullptr;
  if (failure != 0) {
    return Error{"'" + file_->path + "' could not be completed: " + sf_error_number(failure)};
  }
  return Done{};
}

Result<std::string> find_scene(const std::string& name) {
  if (name.empty()) {
    return Error{"expected the name of a model or a preset"};
  }
  std::error_code error;
  const fs::path& data = data_folder();
  for (const fs::path& path : {fs::path(name), fs::path(name + ".toml"), fs::path(name + ".mdl"),
                               data / "presets" / (name + ".toml"), data / "presets" / name,
                               data / "models" / (name + ".mdl"), data / "models" / name}) {
    if (fs::exists(path, error) && !fs::is_directory(path, error)) {
      return path.string();
    }
  }
  if (fs::is_directory(name, error)) {
    return Error{"'" + name + "' is a folder; expected a .mdl model or a .toml preset"};
  }
  std::string known;
  for (const std::string& preset : known_presets()) {
    known += (known.empty() ? "" : ", ") + preset;
  }
  return Error{"there is no model or preset '" + name + "'; there are " +
               (known.empty() ? "none in '" + data.string() + "'" : known) +
               ", or give the path of a .mdl or .toml file"};
}

std::vector<std::string> known_presets() {
  return names_in(data_folder() / "presets", ".toml");
}
std::vector<std::string> known_models() {
  return names_in(data_folder() / "models", ".mdl");
}
std::string models_folder() {
  return (data_folder() / "models").string();
}

}  // namespace ressort
