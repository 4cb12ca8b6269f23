// The text format of flights: a line begins with a word and has numbers after it. An embedded file
// has a line with its size in bytes and its name.
#include <algorithm>
#include <cmath>
#include <map>

#include "app/session/flight/flight.h"
#include "core/kernels/registry.h"
#include "core/model/language/expression.h"

namespace ressort::session {
namespace {

constexpr std::string_view first_line = "ressort flight 1";

struct KindName {
  EventKind kind;
  std::string_view name;
};
constexpr KindName event_names[] = {
    {EventKind::note_on, "note_on"},
    {EventKind::note_off, "note_off"},
    {EventKind::controller, "controller"},
    {EventKind::program, "program"},
    {EventKind::pressure, "pressure"},
    {EventKind::key_pressure, "key_pressure"},
    {EventKind::bend, "bend"},
    {EventKind::custom, "custom"},
    {EventKind::parameter, "parameter"},
    {EventKind::key_tuning, "key_tuning"},
    {EventKind::tuning_reset, "tuning_reset"},
    {EventKind::gesture, "gesture"},
    {EventKind::strike, "strike"},
    {EventKind::tempo, "tempo"},
    {EventKind::panic, "panic"},
};

template <class Rows, class Value>
std::string name_in(const Rows& rows, Value value) {
  for (const auto& [known, name] : rows) {
    if (known == value) {
      return std::string(name);
    }
  }
  return "?";
}

// --- writing ------------------------------------------------------------------------------------

class FlightWriter {
 public:
  template <class... Words>
  void line(const Words&... words) {
    const std::size_t start = text_.size();
    (add(start, words), ...);
    text_ += '\n';
  }
  void text(const SceneFile& file) {
    line("text", file.text.size(), file.path);
    text_ += file.text;
    text_ += '\n';
  }
  std::string take() { return std::move(text_); }

 private:
  void add(std::size_t start, std::string_view word) {
    text_ += text_.size() > start ? " " : "";
    text_ += word;
  }
  void add(std::size_t start, double number) { add(start, std::string_view(print_number(number))); }
  void add(std::size_t start, std::int64_t number) {
    add(start, std::string_view(std::to_string(number)));
  }
  void add(std::size_t start, std::size_t number) {
    add(start, std::string_view(std::to_string(number)));
  }
  void add(std::size_t start, std::uint32_t number) {
    add(start, static_cast<std::size_t>(number));
  }
  void add(std::size_t start, int number) { add(start, static_cast<std::int64_t>(number)); }

  std::string text_;
};

void print(FlightWriter& out, const FlightSetup& setup) {
  out.line("rescale", setup.rescale ? 1 : 0);
  out.line("voices", setup.voices);
  if (setup.share.of > 1) {
    out.line("share", setup.share.number, setup.share.of);
  }
  if (setup.precision) {
    out.line("precision", precision_name(*setup.precision));
  }
  if (setup.method) {
    out.line("method", method_name(*setup.method));
  }
  if (setup.budget) {
    out.line("budget", print_budget(*setup.budget));
  }
  if (setup.third) {
    out.line("third", static_cast<int>(*setup.third));
  }
  if (setup.keys.a4_hz) {
    out.line("a4", *setup.keys.a4_hz);
  }
  if (setup.keys.transpose != 0) {
    out.line("transpose", setup.keys.transpose);
  }
  if (setup.keys.channels) {
    out.line("channels", *setup.keys.channels);
  }
  if (!setup.keys.scale.empty()) {
    out.line("scale", setup.keys.scale);
  }
  if (!setup.keys.keyboard_map.empty()) {
    out.line("keyboard_map", setup.keys.keyboard_map);
  }
}

void print(FlightWriter& out, const FlightRecord& record) {
  const Event& event = record.event;
  switch (record.kind) {
    case FlightRecord::Kind::event:
      return out.line(record.frame, name_in(event_names, event.kind), event.channel + 0,
                      event.index + 0, event.model, event.value, event.value2,
                      static_cast<int>(event.gesture));
    case FlightRecord::Kind::rate:
      return out.line(record.frame, "rate", event.value);
    case FlightRecord::Kind::period:
      return out.line(record.frame, "period", record.count, record.channels);
    case FlightRecord::Kind::take:
      return out.line(record.frame, "take", record.count);
    case FlightRecord::Kind::limit:
      return out.line(record.frame, "limit", record.count);
    case FlightRecord::Kind::hurry:
      return out.line(record.frame, "hurry");
    case FlightRecord::Kind::gap:
      return;
  }
}

// --- reading ------------------------------------------------------------------------------------

// The words of a line, read in order. `ok` becomes false at a missing or invalid word.
class LineWords {
 public:
  explicit LineWords(std::string_view line) : rest_(line) {}

  std::string_view word() {
    const std::size_t end = std::min(rest_.find(' '), rest_.size());
    const std::string_view word = rest_.substr(0, end);
    rest_.remove_prefix(std::min(rest_.size(), end + 1));
    ok = ok && !word.empty();
    return word;
  }
  double number(double least, double most) {
    double number = 0.0;
    ok = parse_number(word(), number) && ok && number >= least && number <= most;
    return ok ? number : least;
  }
  template <class Whole>
  Whole whole(double most) {
    const double value = number(0.0, most);
    ok = ok && value == std::floor(value);
    return static_cast<Whole>(value);
  }
  std::string rest() { return std::string(std::exchange(rest_, {})); }
  bool is_over() const { return rest_.empty(); }

  bool ok = true;

 private:
  std::string_view rest_;
};

constexpr double most_frames = 9e15;
constexpr double most_number = 1e300;
constexpr double most_count = 4294967295.0;

class FlightReader {
 public:
  explicit FlightReader(std::string_view text) : rest_(text) {}

  Result<Flight> read() {
    if (next() != first_line) {
      return Error{"expected '" + std::string(first_line) + "' at the start of a flight", 1, 1};
    }
    while (!rest_.empty()) {
      const std::string_view line = next();
      LineWords words(line);
      const bool is_record = !line.empty() && line[0] >= '0' && line[0] <= '9';
      if (!(is_record ? read_record(words) : read_line(words)) || !words.ok) {
        return Error{"invalid line in a flight: '" + std::string(line.substr(0, 80)) + "'", line_,
                     1};
      }
    }
    if (flight_.engines.empty() || flight_.records.empty()) {
      return Error{"the flight has no engines or no events", line_, 1};
    }
    return std::move(flight_);
  }

 private:
  std::string_view next() {
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(rest_.size(), end + 1));
    ++line_;
    return line;
  }

  bool read_line(LineWords& words) {
    const std::string_view key = words.word();
    FlightSetup& setup = flight_.setup;
    if (key == "by") {
      flight_.made_by = words.rest();
    } else if (key == "isa") {
      flight_.isa = words.rest();
    } else if (key == "end") {
      flight_.end_frame = words.whole<std::int64_t>(most_frames);
    } else if (key == "audio_inputs") {
      flight_.has_audio_inputs = words.whole<int>(1) != 0;
    } else if (key == "rescale") {
      setup.rescale = words.whole<int>(1) != 0;
    } else if (key == "voices") {
      setup.voices = words.whole<int>(max_voices);
    } else if (key == "share") {
      setup.share.number = words.whole<int>(NoteShare::most_parts);
      setup.share.of = words.whole<int>(NoteShare::most_parts);
      words.ok = words.ok && setup.share.number >= 1 && setup.share.number <= setup.share.of;
    } else if (key == "precision") {
      setup.precision = precision_named(words.word());
      words.ok = words.ok && setup.precision.has_value();
    } else if (key == "method") {
      setup.method = method_named(words.word());
      words.ok = setup.method.has_value();
    } else if (key == "budget") {
      const auto budget = parse_budget(words.rest());
      words.ok = static_cast<bool>(budget);
      setup.budget = budget ? std::optional(*budget) : std::nullopt;
    } else if (key == "third") {
      setup.third = static_cast<ThirdArgument>(words.whole<int>(1));
    } else if (key == "a4") {
      setup.keys.a4_hz = words.number(1.0, 1e5);
    } else if (key == "transpose") {
      setup.keys.transpose = static_cast<int>(words.number(-most_transpose, most_transpose));
    } else if (key == "channels") {
      setup.keys.channels = words.whole<unsigned>(0xffff);
    } else if (key == "scale") {
      setup.keys.scale = words.rest();
    } else if (key == "keyboard_map") {
      setup.keys.keyboard_map = words.rest();
    } else if (key == "texts") {
      texts_.push_back(std::make_shared<std::vector<SceneFile>>());
    } else if (key == "text") {
      return read_text(words);
    } else if (key == "engine") {
      return read_engine(words);
    } else if (key == "form" && !flight_.engines.empty()) {
      flight_.engines.back().forms.push_back(words.rest());
    } else if (key == "kept" && !flight_.engines.empty()) {
      const double value = words.number(-most_number, most_number);
      flight_.engines.back().kept.push_back({words.rest(), value});
    } else {
      return false;
    }
    return words.is_over();
  }

  bool read_text(LineWords& words) {
    const auto bytes = words.whole<std::size_t>(static_cast<double>(max_flight_bytes));
    if (!words.ok || texts_.empty() || bytes > rest_.size()) {
      return false;
    }
    const std::string_view text = rest_.substr(0, bytes);
    texts_.back()->push_back({words.rest(), std::string(text)});
    line_ += static_cast<int>(std::ranges::count(text, '\n'));
    rest_.remove_prefix(bytes);
    return next().empty();
  }

  bool read_engine(LineWords& words) {
    FlightEngine engine;
    const auto texts = words.whole<std::size_t>(most_count);
    engine.number = words.whole<std::uint32_t>(most_count);
    engine.serial = words.whole<std::uint32_t>(most_count);
    engine.lets_ring = words.whole<int>(1) != 0;
    engine.has_new_numbers = words.whole<int>(1) != 0;
    engine.rate_hz = words.number(1000.0, 1e6);
    engine.most_modes = words.whole<std::uint32_t>(most_count);
    engine.find_gain = words.whole<int>(1) != 0;
    engine.force = words.whole<int>(1) != 0;
    engine.gain = words.number(-most_number, most_number);
    engine.path = words.rest();
    if (!words.ok || texts >= texts_.size()) {
      return false;
    }
    engine.files = texts_[texts];
    flight_.engines.push_back(std::move(engine));
    return true;
  }

  bool read_record(LineWords& words) {
    FlightRecord record;
    record.frame = words.whole<std::int64_t>(most_frames);
    const std::string_view kind = words.word();
    Event& event = record.event;
    if (kind == "rate") {
      record.kind = FlightRecord::Kind::rate;
      event.value = words.number(1000.0, 1e6);
    } else if (kind == "period") {
      record.kind = FlightRecord::Kind::period;
      record.count = words.whole<std::uint32_t>(1 << 20);
      record.channels = words.whole<std::uint32_t>(64);
      words.ok = words.ok && record.count > 0;
    } else if (kind == "take" || kind == "limit") {
      record.kind = kind == "take" ? FlightRecord::Kind::take : FlightRecord::Kind::limit;
      record.count = words.whole<std::uint32_t>(most_count);
    } else if (kind == "hurry") {
      record.kind = FlightRecord::Kind::hurry;
    } else {
      const auto* const row = std::ranges::find(event_names, kind, &KindName::name);
      if (row == std::end(event_names)) {
        return false;
      }
      event.kind = row->kind;
      event.channel = words.whole<std::uint8_t>(255);
      const bool is_midi = event.kind != EventKind::parameter && event.kind != EventKind::custom;
      event.index = words.whole<std::uint16_t>(is_midi ? 127 : 65535);
      event.model = words.whole<std::uint32_t>(most_count);
      event.value = words.number(-most_number, most_number);
      event.value2 = words.number(-most_number, most_number);
      event.gesture =
          static_cast<Gesture>(words.whole<int>(static_cast<double>(std::size(gestures)) - 1.0));
    }
    flight_.records.push_back(record);
    return words.is_over();
  }

  std::string_view rest_;
  int line_ = 0;
  Flight flight_;
  std::vector<std::shared_ptr<std::vector<SceneFile>>> texts_;  // texts of models and presets
};

}  // namespace

std::string print_flight(const Flight& flight) {
  FlightWriter out;
  out.line(first_line);
  out.line("by", flight.made_by);
  out.line("isa", flight.isa);
  out.line("end", flight.end_frame);
  out.line("audio_inputs", flight.has_audio_inputs ? 1 : 0);
  print(out, flight.setup);
  std::map<const std::vector<SceneFile>*, std::size_t> texts;  // written texts and their numbers
  for (const FlightEngine& engine : flight.engines) {
    const auto [written, is_new] = texts.try_emplace(engine.files.get(), texts.size());
    if (is_new) {
      out.line("texts");
      for (const SceneFile& file : *engine.files) {
        if (file.is_there) {
          out.text(file);
        }
      }
    }
    out.line("engine", written->second, engine.number, engine.serial, engine.lets_ring ? 1 : 0,
             engine.has_new_numbers ? 1 : 0, engine.rate_hz, engine.most_modes,
             engine.find_gain ? 1 : 0, engine.force ? 1 : 0, engine.gain, engine.path);
    for (const std::string& form : engine.forms) {
      out.line("form", form);
    }
    for (const Setting& setting : engine.kept) {
      out.line("kept", setting.value, setting.parameter);
    }
  }
  for (const FlightRecord& record : flight.records) {
    print(out, record);
  }
  return out.take();
}

Result<Flight> parse_flight(std::string_view text) {
  return FlightReader(text).read();
}

}  // namespace ressort::session
