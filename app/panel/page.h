// app/panel: the page, compiled in. app/panel/page has its files; CMake makes page.cpp of them.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::panel {

struct PageFile {
  std::string_view path;  // "/panel.js"
  std::string_view type;  // "text/javascript; charset=utf-8"
  std::string_view text;
};
std::span<const PageFile> page_files();

}  // namespace ressort::panel
