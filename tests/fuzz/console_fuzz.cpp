// A libFuzzer target: any typed line gets a reply and the sound continues. Files are written to a
// temporary folder of this run, and no other path is used.
#include <unistd.h>
#include <filesystem>

#include "app/control/console.h"
#include "app/control/message.h"
#include "app/session/session.h"
#include "tests/fuzz/player.h"

namespace {

namespace fs = std::filesystem;

// Folder for the files of this run; removed at the end.
struct Folder {
  const fs::path path = fs::temp_directory_path() / ("ressort-fuzz-" + std::to_string(getpid()));
  Folder() {
    fs::create_directories(path);
    fs::current_path(path);
  }
  ~Folder() {
    fs::current_path("/");
    fs::remove_all(path);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  static const Folder folder;
  fuzz::Harness harness;
  Session session(harness.process, {.compile = {.rate_hz = fuzz::Harness::rate_hz}, .third = {}},
                  [](const std::string&) {});
  const auto print = [](const std::string& text) { require(!text.empty()); };
  Console console(harness.process, session, print, print);
  std::string_view text = fuzz::text_of(data, size);
  for (int i = 0; i < 20 && !text.empty() && !console.has_quit(); ++i) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.find('/') != line.npos) {
      continue;
    }
    console.completions(line);
    last_word(line);
    const auto command = parse_command(line);
    require(command || !command.error().message.empty());
    console.run_line(line);
    harness.block(256);
  }
  return 0;
}
