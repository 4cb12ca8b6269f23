#include "app/panel/osc_query.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "app/control/registry.h"

namespace ressort::panel {
namespace {

using nlohmann::json;

enum Access { no_access = 0, readable = 1, writable = 2 };

json bound(double value) {
  return std::isfinite(value) ? json(value) : json();
}

json node(const std::string& path, std::string_view description) {
  return {{"FULL_PATH", path}, {"DESCRIPTION", description}};
}

// Describes an address: its arguments and their ranges.
json method_of(const Row& row, const std::string& path) {
  json out = node(path, row.does);
  std::string types;
  json ranges = json::array();
  for (const CallArgument& argument : row.arguments) {
    if (argument.word.empty()) {
      continue;
    }
    types += argument.is_text ? 's' : 'f';
    json range = json::object();
    if (std::isfinite(argument.least)) {
      range["MIN"] = argument.least;
    }
    if (std::isfinite(argument.most)) {
      range["MAX"] = argument.most;
    }
    ranges.push_back(std::move(range));
  }
  out["TYPE"] = types.empty() ? "N" : types;
  out["ACCESS"] = writable;
  if (!types.empty()) {
    out["RANGE"] = std::move(ranges);
  }
  return out;
}

json parameter_of(const ParameterInfo& info, const std::string& path, double value) {
  json out = node(path, "parameter of the model");
  out["TYPE"] = "f";
  out["ACCESS"] = info.audio_input > 0 ? readable : readable | writable;
  out["VALUE"] = {bound(value)};
  out["RANGE"] = {{{"MIN", bound(info.minimum)}, {"MAX", bound(info.maximum)}}};
  return out;
}

json range_of(const ParameterInfo& info, const std::string& path) {
  json out = node(path, "its minimum, maximum and stable range");
  out["TYPE"] = "ffff";
  out["ACCESS"] = readable;
  out["VALUE"] = {bound(info.minimum), bound(info.maximum), bound(info.safe.lowest),
                  bound(info.safe.highest)};
  return out;
}

class Tree {
 public:
  Tree() : root_(node("/", "ressort")) { root_["ACCESS"] = no_access; }

  void add(const std::string& path, const json& method) {
    json* at = &root_;
    for (std::size_t from = 1, to = 0; from <= path.size(); from = to + 1) {
      to = std::min(path.find('/', from), path.size());
      json& contents = (*at)["CONTENTS"];
      const std::string word = path.substr(from, to - from);
      if (!contents.contains(word)) {
        contents[word] = node(path.substr(0, to), "");
        contents[word]["ACCESS"] = no_access;
      }
      at = &contents[word];
    }
    at->update(method);
  }
  // Null if there is none.
  const json* find(std::string_view path) const {
    const json* at = &root_;
    while (path.size() > 1) {
      path.remove_prefix(1);
      const std::size_t end = std::min(path.find('/'), path.size());
      const auto contents = at->find("CONTENTS");
      const std::string word(path.substr(0, end));
      if (contents == at->end() || !contents->contains(word)) {
        return nullptr;
      }
      at = &contents->at(word);
      path.remove_prefix(end);
    }
    return at;
  }

 private:
  json root_;
};

Tree tree_of(const Session::Present& now) {
  const Instrument& instrument = now.loaded->instrument;
  Tree tree;
  for (const Row* const row : addresses()) {
    const std::size_t input = row->address.find("/N/");
    if (input != std::string::npos) {
      for (const InputInfo& info : instrument.inputs) {
        const GestureRow& gesture = row_of(row->gesture);
        const bool fits = gesture.live == Live::by_preset
                              ? info.knows(row->gesture)
                              : info.is_force == (gesture.live == Live::on_forces);
        std::string path = row->address;
        path.replace(input + 1, 1, std::to_string(info.number));
        if (fits) {
          tree.add(path, method_of(*row, path));
        }
      }
    } else if (row->address.find("NAME") == std::string::npos) {
      tree.add(row->address, method_of(*row, row->address));
    }
  }
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    const std::string path = "/param/" + info.name;
    tree.add(path, parameter_of(info, path, now.values[i]));
    tree.add(path + "/range", range_of(info, path + "/range"));
  }
  constexpr std::size_t most_struck = 200;  // A mesh has thousands of masses.
  for (std::size_t i = 0; i < std::min(most_struck, instrument.struck.size()); ++i) {
    const StruckInfo& info = instrument.struck[i];
    const std::string path = "/mass/" + info.name + (info.moves.empty() ? "" : ":2") + "/strike";
    tree.add(path, method_of(*find_row(path).row, path));
  }
  for (std::size_t i = 0; i < instrument.knobs.size(); ++i) {
    const KnobInfo& knob = instrument.knobs[i];
    json control = node(knob.address(), knob.help.empty() ? knob.name : knob.help);
    control["TYPE"] = "f";
    control["ACCESS"] = readable | writable;
    control["VALUE"] = {now.knobs[i]};
    control["RANGE"] = {{{"MIN", 0.0}, {"MAX", 1.0}}};
    tree.add(knob.address(), control);
  }
  for (const CustomInfo& custom : instrument.custom) {
    json control = node(custom.address, "control of the preset");
    control["TYPE"] = "f";
    control["ACCESS"] = writable;
    control["RANGE"] = {{{"MIN", 0.0}, {"MAX", 1.0}}};
    tree.add(custom.address, control);
  }
  return tree;
}

}  // namespace

OscQueryAnswer osc_query(const Session& session, std::string_view path,
                         std::string_view attribute) {
  const Tree tree = tree_of(session.present());
  const json* const found = tree.find(path);
  if (found == nullptr) {
    return {404, {}};
  }
  if (attribute.empty()) {
    return {200, found->dump(-1, ' ', false, json::error_handler_t::replace)};
  }
  const auto value = found->find(attribute);
  if (value == found->end()) {
    return {204, {}};
  }
  return {200, json{{std::string(attribute), *value}}.dump(-1, ' ', false,
                                                           json::error_handler_t::replace)};
}

std::string osc_host_info(std::optional<int> osc_port) {
  json out{{"NAME", "ressort"},
           {"EXTENSIONS",
            {{"TYPE", true},
             {"ACCESS", true},
             {"VALUE", true},
             {"RANGE", true},
             {"DESCRIPTION", true},
             {"LISTEN", false}}}};
  if (osc_port) {
    out["OSC_PORT"] = *osc_port;
    out["OSC_TRANSPORT"] = "UDP";
  }
  return out.dump();
}

}  // namespace ressort::panel
