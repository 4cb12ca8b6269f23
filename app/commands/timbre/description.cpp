#include "app/commands/timbre/description.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "app/session/sound_file.h"
#include "app/text.h"
#include "core/analysis/timbre/envelope.h"
#include "core/analysis/timbre/modal_spectrum.h"
#include "core/analysis/timbre/pitch.h"

namespace ressort::commands {
namespace {

constexpr std::size_t block_frames = 4096;
// fraction of the loudest frame; softer frames are not counted
constexpr double quietest_share = 1e-3;
constexpr double longest_modal_s = 60.0;      // length of a sound in closed form
constexpr long long most_frames = 4'000'000;  // eleven hours at 48 kHz, and 1.4 GB
constexpr double envelope_rate_hz = 1000.0;

// Reads the mean of all channels, block by block.
class MonoReader {
 public:
  static Result<MonoReader> open(const std::string& path) {
    auto file = SoundReader::open(path);
    return file ? Result<MonoReader>(MonoReader(path, *std::move(file))) : file.error();
  }

  double rate_hz() const { return file_.rate_hz(); }
  std::size_t channels() const { return file_.channels(); }
  long long frames() const { return file_.frames(); }
  long long read_so_far() const { return at_; }

  // Reads a block; empty at the end. Fails at a sample that is not a number.
  Result<std::span<const double>> next() {
    const std::size_t got = file_.read(interleaved_.data(), block_frames);
    const std::size_t channels = file_.channels();
    for (std::size_t n = 0; n < got; ++n) {
      double sum = 0.0;
      for (std::size_t c = 0; c < channels; ++c) {
        sum += interleaved_[n * channels + c];
      }
      if (!std::isfinite(sum)) {
        return Error{"'" + path_ + "': sample " + std::to_string(at_ + static_cast<long long>(n)) +
                     " is not a number"};
      }
      mean_[n] = sum / static_cast<double>(channels);
    }
    at_ += static_cast<long long>(got);
    return std::span<const double>(mean_).first(got);
  }

 private:
  MonoReader(std::string path, SoundReader file)
      : path_(std::move(path)),
        file_(std::move(file)),
        interleaved_(block_frames * file_.channels()),
        mean_(block_frames) {}

  std::string path_;
  SoundReader file_;
  std::vector<double> interleaved_;
  std::vector<double> mean_;
  long long at_ = 0;
};

// Finds the loudest of consecutive stretches of equal length.
class LoudestStretch {
 public:
  explicit LoudestStretch(std::size_t samples) : wanted_(samples) {}
  void add(std::span<const double> samples) {
    for (const double sample : samples) {
      now_.push_back(sample);
      if (now_.size() == wanted_) {
        end();
      }
    }
  }
  // Returns the whole sound if it is shorter.
  const std::vector<double>& get() {
    if (loudest_.empty()) {
      end();
    }
    return loudest_;
  }

 private:
  void end() {
    const double energy = std::inner_product(now_.begin(), now_.end(), now_.begin(), 0.0);
    if (energy > energy_ || loudest_.empty()) {
      energy_ = energy;
      std::swap(loudest_, now_);
    }
    now_.clear();
  }

  std::size_t wanted_;
  std::vector<double> now_;
  std::vector<double> loudest_;
  double energy_ = 0.0;
};

FrameOptions frame_options(const DescriptionOptions& options, double rate_hz,
                           std::optional<double> f0_hz) {
  return {.rate_hz = rate_hz,
          .size = options.frame,
          .window = options.window,
          .kind = options.kind,
          .f0_hz = f0_hz};
}

Error too_short(const std::string& path, long long samples, const DescriptionOptions& options) {
  const std::string has = "'" + path + "' has " +
                          counted(static_cast<std::size_t>(samples), "sample", "samples") + ", ";
  const std::string frame = "a frame of " + std::to_string(options.frame);
  return {options.at ? has + "and " + frame + " at " + std::to_string(*options.at) +
                           " is not within the sound"
                     : has + "less than " + frame + "; pass a shorter --frame"};
}

void keep_frame(Description& description, double& loudest, std::size_t at,
                const FrameTimbre& timbre, const std::vector<double>& spectrum) {
  description.frames.push_back({at, figures_of(timbre)});
  if (timbre.rms > loudest || description.frames.size() == 1) {
    loudest = timbre.rms;
    description.loudest = description.frames.size() - 1;
    description.spectrum = spectrum;
  }
}

// Analyses a frame, with the previous one for the spectral flux.
Result<Description> describe_frame(const std::string& path, MonoReader& sound, long long at,
                                   const DescriptionOptions& options, Description description) {
  const auto hop = static_cast<long long>(options.hop);
  const auto size = static_cast<long long>(options.frame);
  const long long first = at >= hop ? at - hop : at;
  std::vector<double> samples;  // samples from `first` on
  while (sound.read_so_far() < at + size) {
    const long long block_at = sound.read_so_far();
    const auto block = sound.next();
    if (!block) {
      return block.error();
    }
    if (block->empty()) {
      return too_short(path, sound.read_so_far(), options);
    }
    for (long long n = std::max(0LL, first - block_at);
         n < static_cast<long long>(block->size()) && block_at + n < at + size; ++n) {
      samples.push_back((*block)[static_cast<std::size_t>(n)]);
    }
  }
  const auto all = std::span<const double>(samples);
  const auto frame = all.subspan(static_cast<std::size_t>(at - first), options.frame);
  if (!description.f0_hz) {
    description.f0_hz = find_f0(frame, description.rate_hz);
  }
  FrameAnalysis analysis(frame_options(options, description.rate_hz, description.f0_hz));
  if (at > first) {
    static_cast<void>(analysis.next(all.first(options.frame)));
  }
  double loudest = 0.0;
  const FrameTimbre timbre = analysis.next(frame);
  keep_frame(description, loudest, static_cast<std::size_t>(at), timbre, analysis.spectrum());
  description.frequencies_hz = analysis.frequencies_hz();
  description.samples = sound.frames() >= 0 ? sound.frames() : sound.read_so_far();
  return description;
}

// Returns a quantile of each figure over the frames, linearly interpolated.
double quantile(std::vector<double>& values, double share) {
  const double place = share * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), values.begin() + low, values.end());
  const double below = values[static_cast<std::size_t>(low)];
  if (low + 1 == static_cast<std::ptrdiff_t>(values.size())) {
    return below;
  }
  const double above = *std::min_element(values.begin() + low + 1, values.end());
  return below + (place - static_cast<double>(low)) * (above - below);
}

}  // namespace

Result<Description> describe_sound(const std::string& path, const DescriptionOptions& options,
                                   const DescriptionProgress& progress) {
  auto first = MonoReader::open(path);
  if (!first) {
    return first.error();
  }
  Description description{.of = path,
                          .rate_hz = first->rate_hz(),
                          .channels = first->channels(),
                          .f0_hz = options.f0_hz};
  if (options.at) {
    return describe_frame(path, *first, *options.at, options, std::move(description));
  }
  const auto each_block = [&](double pass, MonoReader& reader, auto&& use) -> Result<Done> {
    const auto all = static_cast<double>(std::max(1LL, reader.frames()));
    while (true) {
      const auto block = reader.next();
      if (!block) {
        return block.error();
      }
      if (block->empty()) {
        return Done{};
      }
      use(*block);
      if (!progress(0.5 * (pass + static_cast<double>(reader.read_so_far()) / all))) {
        return Error{description_stopped};
      }
    }
  };
  LoudestStretch loudest_stretch(std::max(options.frame, pitch_samples(description.rate_hz)));
  EnvelopeSums sums;
  Envelope rough(description.rate_hz, [&](double value) { sums.add(value); });
  auto read = each_block(0.0, *first, [&](std::span<const double> block) {
    loudest_stretch.add(block);
    rough.add(block);
  });
  if (!read) {
    return read.error();
  }
  rough.end();
  description.samples = first->read_so_far();
  if (description.samples < static_cast<long long>(options.frame)) {
    return too_short(path, description.samples, options);
  }
  const auto frame_count = (description.samples - static_cast<long long>(options.frame)) /
                               static_cast<long long>(options.hop) +
                           1;
  if (frame_count > most_frames) {
    return Error{"'" + path + "' has " + std::to_string(frame_count) + " frames, more than " +
                 std::to_string(most_frames) + "; pass a larger --hop"};
  }
  if (!description.f0_hz) {
    description.f0_hz = find_f0(loudest_stretch.get(), description.rate_hz);
  }

  auto second = MonoReader::open(path);
  if (!second) {
    return second.error();
  }
  EnvelopeTimes times(sums);
  Envelope again(description.rate_hz, [&](double value) { times.add(value); });
  double loudest = 0.0;
  FrameStream frames(frame_options(options, description.rate_hz, description.f0_hz), options.hop,
                     [&](std::size_t at, const FrameTimbre& timbre, const FrameAnalysis& analysis) {
                       keep_frame(description, loudest, at, timbre, analysis.spectrum());
                       if (description.frequencies_hz.empty()) {
                         description.frequencies_hz = analysis.frequencies_hz();
                       }
                     });
  read = each_block(1.0, *second, [&](std::span<const double> block) {
    again.add(block);
    frames.add(block);
  });
  if (!read) {
    return read.error();
  }
  again.end();
  if (second->read_so_far() != description.samples) {
    return Error{"'" + path + "' changed while it was being read"};
  }
  description.temporal = times.shape(description.rate_hz);
  return description;
}

Result<Description> describe_modes(const NetworkModes& modes, const DescriptionOptions& options) {
  Description description{.of = "its modes, in closed form, from " + std::string("in1 to out1"),
                          .rate_hz = modes.rate_hz,
                          .f0_hz = options.f0_hz};
  std::vector<DecayingPartial> partials;
  double loudest_mode = 0.0;
  for (const NetworkMode& mode : modes.modes) {
    const double level = mode.levels.empty() ? 0.0 : mode.levels[0];
    partials.push_back({mode.frequency_hz, pole_radius(mode.t60_s, modes.rate_hz), level});
    description.modes.push_back({mode.frequency_hz, mode.t60_s});
    loudest_mode = std::max(loudest_mode, level);
  }
  if (loudest_mode == 0.0) {
    return Error{"no mode is heard from the first input to the first output"};
  }
  for (const DecayingPartial& partial : partials) {
    if (!description.f0_hz && partial.residue > quietest_share * loudest_mode) {
      description.f0_hz = partial.frequency_hz;
    }
  }
  const auto lines_at = [&](std::size_t at) {
    return partials_in_frame(partials, {options.window, options.frame, at}, modes.rate_hz);
  };
  const auto spectrum_of = [&](std::span<const Partial> lines) {
    std::vector<double> spectrum;
    for (const Partial& line : lines) {
      const double a = line.amplitude;
      spectrum.push_back(options.kind == SpectrumKind::magnitude ? a : a * a);
    }
    return spectrum;
  };
  const auto rms_of = [](std::span<const Partial> lines) {
    double sum = 0.0;
    for (const Partial& line : lines) {
      sum += 0.5 * line.amplitude * line.amplitude;
    }
    return std::sqrt(sum);
  };
  const auto first_at = static_cast<std::size_t>(options.at.value_or(0));
  const auto longest = static_cast<std::size_t>(longest_modal_s * modes.rate_hz);
  double first_rms = 0.0;
  double loudest = 0.0;
  std::vector<double> before;
  if (options.at && first_at >= options.hop) {
    before = spectrum_of(lines_at(first_at - options.hop));
  }
  for (std::size_t at = first_at; at <= std::max(longest, first_at); at += options.hop) {
    const std::vector<Partial> lines = lines_at(at);
    const std::vector<double> spectrum = spectrum_of(lines);
    FrameTimbre timbre{.rms = rms_of(lines), .shape = spectral_shape(lines, options.kind)};
    if (!before.empty()) {
      timbre.flux = spectral_flux(before, spectrum);
    }
    if (description.f0_hz) {
      const auto harmonics = harmonics_of(lines, *description.f0_hz);
      timbre.harmonics = harmonic_shape(harmonics, *description.f0_hz);
      timbre.noisiness = noisiness(harmonics, 2.0 * timbre.rms * timbre.rms);
    }
    keep_frame(description, loudest, at, timbre, spectrum);
    if (description.frequencies_hz.empty()) {
      for (const Partial& line : lines) {
        description.frequencies_hz.push_back(line.frequency_hz);
      }
    }
    before = spectrum;
    first_rms = at == first_at ? timbre.rms : first_rms;
    if (options.at || !(timbre.rms > quietest_share * first_rms)) {
      break;
    }
  }
  description.samples =
      static_cast<long long>(description.frames.back().at) + static_cast<long long>(options.frame);
  if (!options.at) {
    std::vector<double> envelope;
    const auto steps = static_cast<std::size_t>(static_cast<double>(description.samples) /
                                                modes.rate_hz * envelope_rate_hz);
    for (std::size_t n = 0; n < std::max<std::size_t>(steps, 2); ++n) {
      double sum = 0.0;
      for (const DecayingPartial& partial : partials) {
        const double a =
            partial.residue * std::pow(partial.pole_radius,
                                       static_cast<double>(n) * modes.rate_hz / envelope_rate_hz);
        sum += a * a;
      }
      envelope.push_back(std::sqrt(sum));
    }
    description.temporal = temporal_shape(envelope, envelope_rate_hz);
  }
  return description;
}

FigureStatistics statistics_of(const Description& description) {
  const std::size_t rms = figure_number("rms");
  const double loudest =
      description.frames.empty() ? 0.0 : *description.frames[description.loudest].values[rms];
  FigureStatistics statistics;
  std::vector<double> values;
  for (std::size_t figure = 0; figure < timbre_figures().size(); ++figure) {
    values.clear();
    for (const DescribedFrame& frame : description.frames) {
      if (*frame.values[rms] >= quietest_share * loudest && frame.values[figure]) {
        values.push_back(*frame.values[figure]);
      }
    }
    statistics.median.emplace_back();
    statistics.interquartile_range.emplace_back();
    if (!values.empty()) {
      statistics.median.back() = quantile(values, 0.5);
      const double low = quantile(values, 0.25);
      statistics.interquartile_range.back() = quantile(values, 0.75) - low;
    }
  }
  return statistics;
}

}  // namespace ressort::commands
