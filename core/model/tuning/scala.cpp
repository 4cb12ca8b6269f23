#include "core/model/tuning/scala.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>

namespace ressort::model {
namespace {

constexpr std::string_view blanks = " \t\v\f";
constexpr std::size_t longest_shown = 32;  // length of quoted text in messages

// Iterates over the lines that are not comments.
class ScalaLines {
 public:
  explicit ScalaLines(std::string_view text) : rest_(text) {}

  // Advances to the next line; returns false at the end. Comments go to `remark`.
  template <class Remark>
  bool next(Remark&& remark) {
    while (!rest_.empty()) {
      const std::size_t end = std::min(rest_.find('\n'), rest_.size());
      line_ = rest_.substr(0, end);
      rest_.remove_prefix(std::min(rest_.size(), end + 1));
      ++number_;
      if (line_.ends_with('\r')) {
        line_.remove_suffix(1);
      }
      if (!line_.starts_with('!')) {
        return true;
      }
      remark(line_.substr(1));
    }
    line_ = {};
    ++number_;
    return false;
  }
  bool next() {
    return next([](std::string_view) {});
  }

  // Returns the first word; the rest of a line, or of a word after '!', is a comment.
  std::string_view word() const {
    const std::size_t start = std::min(line_.find_first_not_of(blanks), line_.size());
    const std::string_view rest = line_.substr(start);
    return rest.substr(0, std::min(rest.find_first_of(" \t\v\f!"), rest.size()));
  }
  int number() const { return number_; }

  Error expected(const std::string& what) const {
    const std::string_view found = word();
    const std::size_t start = std::min(line_.find_first_not_of(blanks), line_.size());
    return {
        "expected " + what + ", found " +
            (found.empty() ? "nothing" : "'" + std::string(found.substr(0, longest_shown)) + "'"),
        number_, static_cast<int>(start) + 1};
  }

 private:
  std::string_view rest_;
  std::string_view line_;
  int number_ = 0;
};

// Returns the number if the whole text is one.
template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [last, failure] = std::from_chars(text.data(), end, number);
  return failure == std::errc{} && last == end && !text.empty() ? std::optional(number)
                                                                : std::nullopt;
}

// Returns the cents of a pitch: with a point it is in cents, without one a ratio or a whole number.
std::optional<double> cents_of(std::string_view word) {
  constexpr double most_cents = 120'000.0;  // a hundred octaves
  if (word.find('.') != word.npos) {
    const auto cents = number_of<double>(word);
    return cents && std::fabs(*cents) <= most_cents ? cents : std::nullopt;
  }
  const std::size_t slash = word.find('/');
  const auto whole = [](std::string_view digits) {  // of any length
    const bool is_whole = digits.find_first_not_of("0123456789") == digits.npos;
    return is_whole ? number_of<double>(digits).value_or(0.0) : 0.0;
  };
  const double above = whole(word.substr(0, slash));
  const double below = slash == word.npos ? 1.0 : whole(word.substr(slash + 1));
  return above > 0.0 && below > 0.0 ? std::optional(1200.0 * std::log2(above / below))
                                    : std::nullopt;
}

// Reads an extension of .ascl files: "@ABL REFERENCE_PITCH octave step hz". Octave 4 starts at
// middle C.
std::optional<ReferencePitch> reference_of(std::string_view comment) {
  std::array<double, 3> numbers{};
  constexpr std::string_view name = "@ABL REFERENCE_PITCH ";
  const std::size_t start = comment.find(name);
  if (start == comment.npos || comment.find_first_not_of(blanks) != start) {
    return std::nullopt;
  }
  std::string_view rest = comment.substr(start + name.size());
  for (double& number : numbers) {
    rest.remove_prefix(std::min(rest.find_first_not_of(blanks), rest.size()));
    const std::size_t length = std::min(rest.find_first_of(blanks), rest.size());
    const auto read = number_of<double>(rest.substr(0, length));
    if (!read) {
      return std::nullopt;
    }
    number = *read;
    rest.remove_prefix(length);
  }
  const auto [octave, step, hz] = numbers;
  constexpr double most = 1024.0;
  return std::fabs(octave) <= 20.0 && std::fabs(step) <= most && hz >= 1.0 && hz <= 20'000.0
             ? std::optional(ReferencePitch{static_cast<int>(octave), static_cast<int>(step), hz})
             : std::nullopt;
}

}  // namespace

Result<Scale> parse_scale(std::string_view text) {
  ScalaLines lines(text);
  if (text.size() > max_tuning_bytes) {
    return Error{"the scale is longer than 64 KiB", 1, 1};
  }
  if (!lines.next()) {
    return lines.expected("a line that describes the scale");
  }
  lines.next();
  const auto count = number_of<int>(lines.word());
  if (!count || *count < 0 || *count > max_scale_notes) {
    return lines.expected("how many notes the scale has, 0 to " + std::to_string(max_scale_notes));
  }
  Scale scale;
  for (int note = 1; note <= *count; ++note) {
    lines.next();
    const auto cents = cents_of(lines.word());
    if (!cents) {
      return lines.expected("note " + std::to_string(note) + " of " + std::to_string(*count) +
                            ", as cents with a point (701.955) or as a ratio (3/2)");
    }
    scale.cents.push_back(*cents);
  }
  if (scale.cents.empty()) {
    scale.cents.push_back(0.0);  // 1/1 only: all keys sound alike
  }
  lines.next([&](std::string_view comment) {
    const auto reference = reference_of(comment);
    scale.reference = reference ? reference : scale.reference;
  });
  return scale;
}

KeyboardMap usual_map(const Scale& scale) {
  KeyboardMap map;
  if (scale.reference) {
    const auto notes = static_cast<int>(scale.cents.size());
    map.reference_key =
        map.middle_key + (scale.reference->octave - 4) * notes + scale.reference->step;
    map.reference_hz = scale.reference->hz;
  }
  return map;
}

Result<KeyboardMap> parse_keyboard_map(std::string_view text) {
  ScalaLines lines(text);
  if (text.size() > max_tuning_bytes) {
    return Error{"the keyboard map is longer than 64 KiB", 1, 1};
  }
  KeyboardMap map;
  int size = 0;
  const struct {
    int& value;
    int most;
    const char* what;
  } heads[] = {{size, max_mapped_keys, "how many keys the map has"},
               {map.first_key, 127, "the first key that is retuned"},
               {map.last_key, 127, "the last key that is retuned"},
               {map.middle_key, 127, "the key that plays step 0"},
               {map.reference_key, 127, "the key whose frequency is given"}};
  for (const auto& head : heads) {
    lines.next();
    const auto value = number_of<int>(lines.word());
    if (!value || *value < 0 || *value > head.most) {
      return lines.expected(std::string(head.what) + ", 0 to " + std::to_string(head.most));
    }
    head.value = *value;
  }
  lines.next();
  const auto hz = number_of<double>(lines.word());
  if (!hz || !(*hz >= 1.0 && *hz <= 20'000.0)) {
    return lines.expected("that key's frequency, 1 to 20000 Hz");
  }
  map.reference_hz = *hz;
  lines.next();
  const auto octave = number_of<int>(lines.word());
  if (!octave || *octave < 0 || *octave > max_mapped_keys) {
    return lines.expected("the step at which the map repeats, 0 to " +
                          std::to_string(max_mapped_keys));
  }
  map.octave_steps = *octave;
  // Keys missing at the end are silent.
  map.steps.resize(static_cast<std::size_t>(size));
  for (int key = 0; key < size && lines.next(); ++key) {
    const std::string_view word = lines.word();
    if (word.empty()) {
      continue;  // an empty last line
    }
    const auto step = number_of<int>(word);
    const bool is_silent = word == "x" || word == "X";
    if (!is_silent && (!step || *step < 0 || *step > max_mapped_keys)) {
      return lines.expected("the step of key " + std::to_string(key) + " of the map, 0 to " +
                            std::to_string(max_mapped_keys) + ", or x for none");
    }
    map.steps[static_cast<std::size_t>(key)] = step;
  }
  return map;
}

Result<std::vector<double>> key_frequencies(const Scale& scale, const KeyboardMap& map) {
  const auto notes = static_cast<int>(scale.cents.size());
  const auto floor_divided = [](int a, int b) { return a / b - (a % b < 0 ? 1 : 0); };
  const auto cents_of_step = [&](int step) {
    const int period = floor_divided(step, notes);
    const int note = step - period * notes;
    return period * scale.cents.back() +
           (note == 0 ? 0.0 : scale.cents[static_cast<std::size_t>(note) - 1]);
  };
  const auto cents_of_key = [&](int key) -> std::optional<double> {
    const int away = key - map.middle_key;
    if (map.steps.empty()) {
      return cents_of_step(away);
    }
    const auto size = static_cast<int>(map.steps.size());
    const int turn = floor_divided(away, size);
    const auto step = map.steps[static_cast<std::size_t>(away - turn * size)];
    const int octave = map.octave_steps == 0 ? notes : map.octave_steps;
    return step ? std::optional(cents_of_step(*step) + turn * cents_of_step(octave)) : std::nullopt;
  };
  // A reference key without a step lies between the two keys around it that have one.
  const auto mapped_from = [&](int key, int way) {
    const auto size = std::max<std::size_t>(map.steps.size(), 1);
    for (std::size_t i = 0; i < size && !cents_of_key(key); ++i) {
      key += way;
    }
    return key;
  };
  const int below = mapped_from(map.reference_key, -1);
  const int above = mapped_from(map.reference_key, 1);
  const auto low = cents_of_key(below);
  const auto high = cents_of_key(above);
  if (!low || !high) {
    return Error{"the keyboard map makes all keys silent"};
  }
  const double reference =
      *low +
      (above == below ? 0.0 : (*high - *low) * (map.reference_key - below) / (above - below));
  std::vector<double> frequencies;
  for (int key = 0; key < 128; ++key) {
    const auto cents = cents_of_key(key);
    const bool is_mapped = key >= map.first_key && key <= map.last_key;
    const double hz = !is_mapped ? 440.0 * std::exp2((key - 69) / 12.0)
                      : cents    ? map.reference_hz * std::exp2((*cents - reference) / 1200.0)
                                 : 0.0;
    constexpr double lowest_hz = 1e-3;
    constexpr double highest_hz = 1e6;
    if (hz != 0.0 && !(hz >= lowest_hz && hz <= highest_hz)) {
      // A distant step of a wide scale may be inaudible; that is not an error.
      frequencies.push_back(0.0);
      continue;
    }
    frequencies.push_back(hz);
  }
  return frequencies;
}

}  // namespace ressort::model
