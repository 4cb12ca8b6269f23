#include "app/commands/output.h"

#include <stdlib.h>

#include <cerrno>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/load_progress.h"
#include "app/version.h"

namespace ressort::commands {

void print_error(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
}

int reject(const std::string& message) {
  print_error(message);
  return exit_code::wrong_use;
}

std::string made_today() {
  const std::time_t now = std::time(nullptr);
  char date[16] = "";
  std::tm local{};
  if (localtime_r(&now, &local) != nullptr) {
    std::strftime(date, sizeof date, "%Y-%m-%d", &local);
  }
  return std::string("ressort ") + version + " (" + commit + "), " + date;
}

Progress report_stages(const std::string& name) {
  const auto news = std::make_shared<LoadProgress>(name, print_error);
  return Progress([news](std::string_view stage) {
    news->at(stage);
    return true;
  });
}

int put_figure(const std::string& path, const plot::Figure& figure, bool force) {
  const auto picture =
      plot::draw(figure, path.ends_with(".png") ? plot::Format::png : plot::Format::svg);
  if (!picture) {
    print_error(path + ": not drawn: " + picture.error().message);
    return exit_code::our_failure;
  }
  return write_output(path, *picture, force);
}

Result<TemporaryFolder> TemporaryFolder::make() {
  std::error_code error;
  std::string path = (std::filesystem::temp_directory_path(error) / "ressort-XXXXXX").string();
  if (error || mkdtemp(path.data()) == nullptr) {
    return Error{"cannot create a temporary folder: " +
                 (error ? error : std::error_code(errno, std::generic_category())).message()};
  }
  return TemporaryFolder(std::move(path));
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  if (!path_.empty()) {
    std::filesystem::remove_all(path_, error);
  }
}

}  // namespace ressort::commands
