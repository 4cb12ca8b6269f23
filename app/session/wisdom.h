// app/session: the measured times of forms, kept in the user's cache so that each is measured once
// on a machine.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "app/rooms.h"

namespace ressort::session {

// Returns the file in the user's cache; empty if the home folder is unknown.
std::string wisdom_path();

// A store of numbers by key. The program's version and the processor's model are part of every key,
// so that one file serves several machines. A file that is missing, damaged or unreadable counts as
// empty and is replaced by the next save(). [one thread]
class Wisdom {
 public:
  explicit Wisdom(std::string path) : path_(std::move(path)) {}

  std::optional<double> recall(const std::string& key);
  void keep(const std::string& key, double ns);
  // Writes new entries to the file, beside those that other processes have written meanwhile. Does
  // nothing if there are none, or if there is no path.
  void save();

 private:
  std::map<std::string, double>& known();  // reads the file at the first call

  std::string path_;
  std::optional<std::map<std::string, double>> known_;  // nothing before the file is read
  std::map<std::string, double> added_;                 // since the last save()
};

}  // namespace ressort::session
