// app/panel: the web page, compiled in. CMake generates page.cpp from app/panel/page.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::panel {

struct PageFile {
  std::string_view path;  // Such as "/panel.js".
  std::string_view type;  // Such as "text/javascript; charset=utf-8".
  std::string_view text;
};
std::span<const PageFile> page_files();

}  // namespace ressort::panel
