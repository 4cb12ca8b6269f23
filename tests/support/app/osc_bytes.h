// tests: OSC packets made and read without liblo.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace ressort {

using Bytes = std::vector<std::uint8_t>;
using Value = std::variant<std::int32_t, float, double, std::string>;

inline void put(Bytes& bytes, std::uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

inline void put(Bytes& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.resize(bytes.size() / 4 * 4 + 4);
}

inline void put(Bytes& bytes, const Value& value) {
  if (const auto* const whole = std::get_if<std::int32_t>(&value)) {
    put(bytes, static_cast<std::uint32_t>(*whole), 4);
  } else if (const auto* const real = std::get_if<float>(&value)) {
    put(bytes, std::bit_cast<std::uint32_t>(*real), 4);
  } else if (const auto* const precise = std::get_if<double>(&value)) {
    put(bytes, std::bit_cast<std::uint64_t>(*precise), 8);
  } else {
    put(bytes, std::string_view(std::get<std::string>(value)));
  }
}

inline Bytes message(std::string_view address, const std::vector<Value>& values = {}) {
  Bytes bytes;
  put(bytes, address);
  std::string tags = ",";
  for (const Value& value : values) {
    tags += "ifds"[value.index()];
  }
  put(bytes, std::string_view(tags));
  for (const Value& value : values) {
    put(bytes, value);
  }
  return bytes;
}

inline Bytes bundle(std::uint64_t time_tag, const std::vector<Bytes>& elements) {
  Bytes bytes;
  put(bytes, std::string_view("#bundle"));
  put(bytes, time_tag, 8);
  for (const Bytes& element : elements) {
    put(bytes, element.size(), 4);
    bytes.insert(bytes.end(), element.begin(), element.end());
  }
  return bytes;
}

struct Answer {
  std::string address;
  std::vector<Value> values;
  const std::string& text(std::size_t i) const { return std::get<std::string>(values.at(i)); }
};

inline Answer read_answer(const Bytes& bytes) {
  const auto text_at = [&](std::size_t& at) {
    const std::string text(reinterpret_cast<const char*>(bytes.data() + at));
    at += text.size() / 4 * 4 + 4;
    return text;
  };
  const auto number_at = [&](std::size_t& at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t end = at + size; at < end; ++at) {
      value = value << 8 | bytes.at(at);
    }
    return value;
  };
  std::size_t at = 0;
  Answer answer{text_at(at), {}};
  for (const char tag : text_at(at).substr(1)) {
    if (tag == 's') {
      answer.values.emplace_back(text_at(at));
    } else if (tag == 'd') {
      answer.values.emplace_back(std::bit_cast<double>(number_at(at, 8)));
    } else if (const auto word = static_cast<std::uint32_t>(number_at(at, 4)); tag == 'f') {
      answer.values.emplace_back(std::bit_cast<float>(word));
    } else {
      answer.values.emplace_back(static_cast<std::int32_t>(word));
    }
  }
  return answer;
}

// Returns the bytes of a literal, including zeros.
inline Bytes raw(std::string_view text) {
  return Bytes(text.begin(), text.end());
}
#define RAW(literal) ressort::raw(std::string_view(literal, sizeof(literal) - 1))

}  // namespace ressort
