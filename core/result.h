// core: the result of a function that can fail. Core throws no exceptions across its interface.
#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace ressort {

// An error message for the user. `line` and `column` count from 1; 0: the error has no position.
struct Error {
  std::string message;
  int line = 0;
  int column = 0;
};

// Either a value or an Error. Check before access: `if (!r) return r.error();`.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : content_(std::in_place_index<1>, std::move(error)) {}

  explicit operator bool() const { return content_.index() == 0; }
  T& operator*() & { return value(); }
  const T& operator*() const& { return const_cast<Result*>(this)->value(); }
  T&& operator*() && { return std::move(value()); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &const_cast<Result*>(this)->value(); }
  const Error& error() const { return *std::get_if<1>(&content_); }

 private:
  T& value() {
    assert(content_.index() == 0);
    return *std::get_if<0>(&content_);
  }
  std::variant<T, Error> content_;
};

// The value of functions that return success only.
struct Done {};

}  // namespace ressort
