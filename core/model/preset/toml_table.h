// core/model: reads TOML and collects all errors with their places.
#pragma once

#include <cmath>
#include <cstdio>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/model/language/tokens.h"
#include "core/model/preset/preset.h"
#include "core/model/preset/toml.h"

namespace ressort::model {

inline SourceLocation location_of(const toml::node& node) {
  return {static_cast<int>(node.source().begin.line), static_cast<int>(node.source().begin.column)};
}

// Reads values from one table and collects all errors. The readers return true if the value exists
// and is valid.
class TomlTable {
 public:
  TomlTable(const toml::table& table, std::string name, std::vector<Error>& errors)
      : table_(table), name_(std::move(name)), errors_(errors) {}

  // Reports keys that `keys` does not list for this table.
  void allow(std::string_view table, std::span<const PresetKey> keys = preset_keys()) {
    for (const auto& [key, value] : table_) {
      bool is_known = false;
      std::string expected;
      for (const PresetKey& known : keys) {
        if (known.table == table) {
          is_known |= known.key == key.str();
          expected += (expected.empty() ? "" : ", ") + std::string(known.key);
        }
      }
      if (!is_known) {
        fail(value,
             "unknown key " + quoted(key.str()) + " in " + name_ + "; there are " + expected);
      }
    }
  }

  bool number(std::string_view key, double& target, double least, double most) {
    const toml::node* node = table_.get(key);
    return node != nullptr && number(*node, key, target, least, most);
  }

  void integer(std::string_view key, int& target, int least, int most) {
    double value = target;
    if (number(key, value, least, most) && value != std::floor(value)) {
      fail(*table_.get(key), "'" + std::string(key) + "' must be a whole number");
    }
    target = static_cast<int>(value);
  }

  bool text(std::string_view key, std::string& target) {
    return take(key, target, "a text in quotes");
  }
  bool flag(std::string_view key, bool& target) { return take(key, target, "true or false"); }

  // Reads [low, high].
  bool pair(std::string_view key, double& low, double& high, double least = -1e12,
            double most = 1e12) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return false;
    }
    const toml::array* both = node->as_array();
    if (both == nullptr || both->size() != 2) {
      return fail(*node, "'" + std::string(key) + "' must be two numbers: [low, high]");
    }
    const bool is_first = number((*both)[0], key, low, least, most);
    return number((*both)[1], key, high, least, most) && is_first;
  }
  // Reads [low, high] and checks their order.
  bool range(std::string_view key, double& low, double& high, double least = -1e12,
             double most = 1e12) {
    if (!pair(key, low, high, least, most)) {
      return false;
    }
    return low <= high ||
           fail(*table_.get(key), "'" + std::string(key) +
                                      "' is the wrong way round: write the lower number "
                                      "first, [low, high]");
  }

  const toml::node* get(std::string_view key) const { return table_.get(key); }

  // Adds an error; returns false.
  bool fail(const toml::node& node, std::string message) {
    return fail(location_of(node), std::move(message));
  }
  bool fail(SourceLocation location, std::string message) {
    errors_.push_back({std::move(message), location.line, location.column});
    return false;
  }

 private:
  bool number(const toml::node& node, std::string_view key, double& target, double least,
              double most) {
    const auto value = node.value<double>();
    if (!value || node.is_boolean() || !std::isfinite(*value)) {
      return fail(node, "'" + std::string(key) + "' must be a number");
    }
    if (*value < least || *value > most) {
      char range[80];
      std::snprintf(range, sizeof range, "must lie between %g and %g", least, most);
      return fail(node, "'" + std::string(key) + "' " + range);
    }
    target = *value;
    return true;
  }

  template <class T>
  bool take(std::string_view key, T& target, std::string_view expected) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return false;
    }
    if (!node->is<T>()) {
      return fail(*node, "'" + std::string(key) + "' must be " + std::string(expected));
    }
    target = *node->value<T>();
    return true;
  }

  const toml::table& table_;
  std::string name_;
  std::vector<Error>& errors_;
};

// Parses TOML of at most max_preset_bytes that is nested at most 8 levels deep, or returns the
// error with its place. O(n)
Result<toml::table> parse_toml(std::string_view text);

}  // namespace ressort::model
