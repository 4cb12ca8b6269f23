#include "app/commands/play/kept_stage.h"

#include <filesystem>

#include "app/session/files.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

namespace fs = std::filesystem;

constexpr const char* list_name = "stage.txt";
constexpr std::string_view list_head = "ressort stage 1";

// Returns the rest of a line after its first word.
std::optional<std::string> behind(std::string_view line, std::string_view word) {
  return line.starts_with(word) && line.size() > word.size() && line[word.size()] == ' '
             ? std::optional(std::string(line.substr(word.size() + 1)))
             : std::nullopt;
}

}  // namespace

Result<Done> save_state_to(const std::string& folder, Session& session,
                           const std::vector<Cable>& cables) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return Error{"cannot create the folder '" + folder + "': " + error.message()};
  }
  const auto scene = session.save_to(folder);
  if (!scene) {
    return scene.error();
  }
  std::string list = std::string(list_head) + "\nscene " + *scene + "\n";
  for (const std::string& path : session.tuning()) {
    const std::string name = fs::path(path).filename().string();
    const auto text = read_text(path, max_model_bytes);
    if (!text) {
      return text.error();
    }
    if (auto written = write_text((fs::path(folder) / name).string(), *text, Existing::replace);
        !written) {
      return written;
    }
    list += "tuning " + name + "\n";
  }
  for (const Cable& cable : cables) {
    list += "cable " + cable.ours + " " + cable.theirs + "\n";
  }
  // Written last: the list names the files that belong to the stage.
  return write_text((fs::path(folder) / list_name).string(), list, Existing::replace);
}

std::string current_state(const Session& session) {
  const Session::Present now = session.present();
  if (now.loaded->serial == 0) {
    return "";
  }
  std::string state = now.loaded->path;
  for (const double value : now.values) {
    state += " " + print_number(value);
  }
  for (const std::string& path : session.tuning()) {
    state += " " + path;
  }
  return state;
}

Result<SavedState> read_saved_state(const std::string& folder) {
  SavedState stage;
  const fs::path path = fs::path(folder) / list_name;
  std::error_code error;
  if (!fs::exists(path, error)) {
    return stage;
  }
  auto text = read_text(path.string(), max_model_bytes);
  if (!text) {
    return text.error();
  }
  int line = 0;
  for (std::string_view rest = *text; !rest.empty();) {
    const std::string_view said = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), said.size() + 1));
    ++line;
    if (line == 1 && said == list_head) {
      continue;
    }
    if (const auto scene = behind(said, "scene")) {
      stage.scene = (fs::path(folder) / *scene).string();
    } else if (const auto tuning = behind(said, "tuning")) {
      stage.tuning.push_back((fs::path(folder) / *tuning).string());
    } else if (const auto cable = behind(said, "cable");
               cable && cable->find(' ') != std::string::npos) {
      // Port names of other programs may contain blanks; ours never do.
      stage.cables.push_back(
          {cable->substr(0, cable->find(' ')), cable->substr(cable->find(' ') + 1)});
    } else {
      return Error{path.string() + ":" + std::to_string(line) +
                   ":1: error: expected 'scene', 'tuning' or 'cable', found '" +
                   std::string(said.substr(0, 40)) + "'"};
    }
  }
  return stage;
}

}  // namespace ressort::commands
