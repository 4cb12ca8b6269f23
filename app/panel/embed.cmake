# Writes OUTPUT, a source with the files of the page in FOLDER as byte arrays, because compilers need not
# accept string literals above 64 kB. The browser gets them without comments and spare spaces.
set(types "html|text/html" "css|text/css" "js|text/javascript" "svg|image/svg+xml")
set(arrays "")
set(rows "")
foreach(file index.html panel.css panel.js draw.js icon.svg)
  file(READ ${FOLDER}/${file} text)
  string(REGEX REPLACE "\n +" "\n" text "${text}")
  string(REGEX REPLACE "(\n|  )//[^\n]*" "" text "${text}")
  if(file MATCHES "css$")
    string(REGEX REPLACE " *([{}:,;])[ \n]*" "\\1" text "${text}")
  endif()
  string(HEX "${text}" bytes)
  string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
  string(MAKE_C_IDENTIFIER ${file} name)
  string(APPEND arrays "const unsigned char ${name}[] = {${bytes}};\n")
  foreach(type IN LISTS types)
    string(REPLACE "|" ";" type "${type}")
    list(GET type 0 ending)
    if(file MATCHES "\\.${ending}$")
      list(GET type 1 mime)
    endif()
  endforeach()
  set(path "/${file}")
  if(file STREQUAL index.html)
    set(path "/")
  endif()
  string(APPEND rows "    {\"${path}\", \"${mime}; charset=utf-8\",\n"
    "     {reinterpret_cast<const char*>(${name}), sizeof ${name}}},\n")
endforeach()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT [[
#include "app/panel/page.h"

namespace ressort::panel {
namespace {

@arrays@
}  // namespace

std::span<const PageFile> page_files() {
  static const PageFile files[] = {
@rows@  };
  return files;
}

}  // namespace ressort::panel
]] @ONLY)
