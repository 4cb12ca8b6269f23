// app/commands: a picture that can stand in a page.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "app/rooms.h"

namespace ressort::commands {

// "data:image/png;base64,...": `pixels` are grey, 0 is black, [row from the top][column]. Empty
// where there is no memory for it.
std::string png_data_url(std::span<const std::uint8_t> pixels, std::size_t width,
                         std::size_t height);

}  // namespace ressort::commands
