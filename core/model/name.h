// core/model: a string of 16 bytes. A network may have millions of labels, most of them short.
#pragma once

#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "core/rooms.h"

namespace ressort::model {

// Stores up to 15 bytes inline, longer labels on the heap.
class Name {
 public:
  Name() = default;
  Name(std::string_view text) {
    if (text.size() <= most_held) {
      text.copy(bytes_.data(), text.size());
      bytes_[most_held] = static_cast<char>(text.size());
    } else {
      const std::string* const owned = new std::string(text);
      std::memcpy(bytes_.data(), &owned, sizeof(void*));
      bytes_[most_held] = elsewhere;
    }
  }
  Name(const std::string& text) : Name(std::string_view(text)) {}
  Name(const char* text) : Name(std::string_view(text)) {}
  Name(const Name& other) : Name(std::string_view(other)) {}
  Name(Name&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  Name& operator=(Name other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Name() {
    if (bytes_[most_held] == elsewhere) {
      delete owned();
    }
  }

  operator std::string_view() const {
    return bytes_[most_held] == elsewhere
               ? std::string_view(*owned())
               : std::string_view(bytes_.data(), static_cast<std::size_t>(bytes_[most_held]));
  }
  std::string text() const { return std::string(std::string_view(*this)); }
  bool empty() const { return bytes_[most_held] == 0; }
  friend bool operator==(const Name& a, const Name& b) {
    return std::string_view(a) == std::string_view(b);
  }

 private:
  static constexpr std::size_t most_held = 15;
  static constexpr char elsewhere = 127;

  const std::string* owned() const {
    const std::string* text = nullptr;
    std::memcpy(&text, bytes_.data(), sizeof(void*));
    return text;
  }

  std::array<char, most_held + 1> bytes_{};  // the last byte is the length, or `elsewhere`
};

}  // namespace ressort::model
