#include "app/commands/chart/ways.h"

#include <algorithm>
#include <span>

namespace ressort::commands {
namespace {

constexpr unsigned oversamplings[] = {2, 4, 8};
constexpr const char* silences[] = {"-120", "-100", "-80", "-60", "-40"};
constexpr const char* usual_silences[] = {"-100", "-80", "-60"};

// A budget and its name in the line.
struct NamedBudget {
  std::string name;
  std::string budget;
};
const NamedBudget every_method[] = {{"", ""}, {"passive", "passive=always"}};
const NamedBudget plans_choice[] = {
    {"auto", ""}, {"auto cents=1", "cents=1"}, {"auto passive", "passive=always"}};

std::string together(const std::string& a, const std::string& b) {
  return a + (a.empty() || b.empty() ? "" : " ") + b;
}

void add_method(std::vector<Way>& ways, Method method) {
  const std::string name(method_name(method));
  for (const NamedBudget& asked : every_method) {
    const std::string line = together(name, asked.name);
    ways.push_back({.name = line, .line = line, .method = method, .budget = asked.budget});
    for (const unsigned times : oversamplings) {
      if (method == Method::direct) {  // The other methods have the same error at every rate.
        const std::string label = std::to_string(times) + "x";
        ways.push_back({.name = line + " " + label,
                        .line = line,
                        .label = label,
                        .method = method,
                        .budget = asked.budget,
                        .oversampling = times});
      }
    }
  }
}

// Budgets that drop more and more of the soft modes.
void add_truncation(std::vector<Way>& ways, const std::string& line, std::optional<Method> method,
                    const std::string& budget, std::span<const char* const> levels) {
  if (method && !budget.empty()) {
    ways.push_back({.name = line, .line = line, .method = method, .budget = budget});
  }
  for (const char* const silence : levels) {
    const std::string less = "silence=" + std::string(silence);
    ways.push_back({.name = line + " " + less,
                    .line = line,
                    .label = silence,
                    .method = method,
                    .budget = together(budget, less),
                    .is_bare = method.has_value()});
  }
}

}  // namespace

std::vector<Way> all_ways() {
  std::vector<Way> ways;
  for (const Method method : all_methods()) {
    add_method(ways, method);
  }
  add_truncation(ways, "modal cents=1", Method::modal, "cents=1", silences);
  add_truncation(ways, "modal", Method::modal, "", silences);
  for (const NamedBudget& asked : plans_choice) {
    ways.push_back(
        {.name = asked.name, .line = asked.name, .budget = asked.budget, .is_bare = false});
  }
  add_truncation(ways, "auto", {}, "", usual_silences);
  add_truncation(ways, "auto cents=1", {}, "cents=1", usual_silences);
  std::vector<Way> all;
  for (const Precision precision : {Precision::float64, Precision::float32}) {
    for (Way way : ways) {
      way.precision = precision;
      all.push_back(std::move(way));
    }
  }
  return all;
}

Result<MadeWay> make_way(const ChartScene& scene, const Way& way, double seconds, Isa isa) {
  CompileOptions options{.rate_hz = Network::reference_rate_hz * way.oversampling,
                         .bare = way.is_bare,
                         .voices = 1,
                         .precision = way.precision,
                         .method = way.method,
                         .isa = isa};
  if (!way.budget.empty()) {
    auto budget = parse_budget(way.budget);
    if (!budget) {
      return budget.error();
    }
    options.budget = *budget;
  }
  auto compiled = compile_network(scene.network, Preset{.keyboard = false}, options);
  if (!compiled) {
    return compiled.error();
  }
  MadeWay made{.way = way, .engine = std::move(compiled->engine)};
  const std::vector<Part>& parts = compiled->plan.parts;
  const bool obeys =
      std::ranges::any_of(parts, [&](const Part& part) { return part.method == way.method; });
  if (way.method && !obeys) {
    return Error{std::string(method_name(*way.method)) + " cannot play this network"};
  }
  for (const Part& part : parts) {
    const std::string name(method_name(part.method));
    if (made.methods.find(name) == std::string::npos) {
      made.methods += (made.methods.empty() ? "" : "+") + name;
    }
  }
  made.player = make_player(made.machine(), scene.motions, seconds, way.precision, isa);
  return made;
}

}  // namespace ressort::commands
