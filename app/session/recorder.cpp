#include "app/session/recorder.h"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "app/session/sound_file.h"
#include "app/text.h"

namespace ressort::session {
namespace {

constexpr std::chrono::milliseconds poll_time{10};  // the ring holds several seconds
constexpr double unknown_rate_hz = 44100.0;         // replaced at the first block

}  // namespace

struct Recorder::Work {
  Work(Process& of, MessageHandler handler) : process(of), on_message(std::move(handler)) {}

  Process& process;
  MessageHandler on_message;
  std::string path;
  Existing existing = Existing::refuse;
  std::optional<SoundWriter> file;
  double rate_hz = unknown_rate_hz;  // sample rate of the file
  int channels = 2;
  std::uint64_t frames = 0;       // frames written
  std::uint64_t lost_before = 0;  // Meters::record_lost at the start
  std::uint64_t unfit = 0;        // chunks with another number of channels
  std::optional<Error> failure;   // ends the recording
  std::vector<float> samples;     // samples of one round, written together

  std::mutex mutex;
  std::condition_variable wake;
  bool is_stopping = false;
  Flag has_failed;
  std::thread thread;

  Result<Done> open() {
    file.reset();
    auto opened = SoundWriter::open(path,
                                    {.rate_hz = rate_hz,
                                     .channels = channels,
                                     .preferred = SampleFormat::pcm24,
                                     .is_shown = true},
                                    existing);
    if (!opened) {
      return opened.error();
    }
    file.emplace(*std::move(opened));
    return Done{};
  }

  // Reopens the file if the first chunk has another rate or number of channels than expected.
  void take_form_of(const RecordedChunk& chunk) {
    const double rate_now = process.clock.read().rate_hz;
    if (chunk.channels != channels || rate_now != rate_hz) {
      channels = chunk.channels;
      rate_hz = rate_now;
      if (auto opened = open(); !opened) {
        failure = opened.error();
      }
    }
  }

  void write_what_came() {
    samples.clear();
    RecordedChunk chunk;
    while (process.recording.pop(chunk)) {
      if (frames == 0 && samples.empty()) {
        take_form_of(chunk);
      }
      if (chunk.channels != channels) {
        ++unfit;
        continue;
      }
      const auto count = static_cast<std::ptrdiff_t>(chunk.frames * chunk.channels);
      samples.insert(samples.end(), chunk.samples.begin(), chunk.samples.begin() + count);
    }
    const std::size_t count = samples.size() / static_cast<std::size_t>(channels);
    if (count == 0 || failure) {
      return;
    }
    if (auto written = file->write(samples.data(), count); !written) {
      failure = Error{written.error().message + "; the recording ended after " +
                      fixed(static_cast<double>(frames) / rate_hz, 2) + " s, which are saved"};
      return;
    }
    frames += count;
  }

  // Completes the file.
  void end() {
    if (file) {
      auto closed = failure ? file->salvage() : file->close();
      file.reset();
      if (!closed && !failure) {
        failure = closed.error();
      }
    }
  }

  void work() {
    std::unique_lock lock(mutex);
    while (!wake.wait_for(lock, poll_time, [this] { return is_stopping; })) {
      lock.unlock();
      write_what_came();
      if (failure) {
        process.is_recording.lower();
        end();
        has_failed.raise();  // first, because `on_message` may ask
        on_message(failure->message);
        return;
      }
      lock.lock();
    }
  }
};

Recorder::Recorder(Process& process, MessageHandler on_message)
    : work_(std::make_unique<Work>(process, std::move(on_message))) {}

Recorder::~Recorder() {
  static_cast<void>(stop());
}

bool Recorder::is_running() const {
  return work_->thread.joinable() && !work_->has_failed.is_raised();
}

Result<Done> Recorder::start(const std::string& path, Existing existing) {
  Work& work = *work_;
  if (is_running()) {
    return Error{"a recording to '" + work.path + "' is running"};
  }
  static_cast<void>(stop());  // one that ended by itself
  const double rate_now = work.process.clock.read().rate_hz;
  work.path = path;
  work.existing = existing;
  work.rate_hz = rate_now > 0.0 ? rate_now : unknown_rate_hz;
  work.channels = 2;
  if (auto opened = work.open(); !opened) {
    return opened.error();
  }
  RecordedChunk stale;
  while (work.process.recording.pop(stale)) {
  }
  work.frames = 0;
  work.unfit = 0;
  work.failure.reset();
  work.is_stopping = false;
  work.has_failed.lower();
  work.lost_before = work.process.meters().record_lost;
  work.process.is_recording.raise();
  work.thread = std::thread([&work] { work.work(); });
  return Done{};
}

Result<std::string> Recorder::stop() {
  Work& work = *work_;
  if (!work.thread.joinable()) {
    return Error{"nothing is being recorded"};
  }
  work.process.is_recording.lower();
  {
    const std::lock_guard lock(work.mutex);
    work.is_stopping = true;
  }
  work.wake.notify_all();
  work.thread.join();
  if (!work.failure) {
    work.write_what_came();
    work.end();
  }
  if (work.failure) {
    return *work.failure;
  }
  const std::uint64_t lost = work.process.meters().record_lost - work.lost_before + work.unfit;
  return work.path + ": " + fixed(static_cast<double>(work.frames) / work.rate_hz, 2) + " s, " +
         (lost == 0 ? "nothing lost"
                    : std::to_string(lost) + (lost == 1 ? " piece lost" : " pieces lost"));
}

}  // namespace ressort::session
