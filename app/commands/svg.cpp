#include "app/commands/svg.h"

#include "app/text.h"

namespace ressort::commands {

std::string px(double pixels) {
  std::string text = fixed(pixels, 1);
  return text.ends_with(".0") ? text.substr(0, text.size() - 2) : text;
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    safe += c == '&'   ? "&amp;"
            : c == '<' ? "&lt;"
            : c == '>' ? "&gt;"
            : c == '"' ? "&quot;"
                       : std::string(1, c);
  }
  return safe;
}

std::string label(double x, double y, const std::string& text, const char* anchor) {
  return "<text x=\"" + px(x) + "\" y=\"" + px(y) + "\" text-anchor=\"" + anchor + "\">" +
         escaped(text) + "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const char* colour,
                 const char* width) {
  return "<path d=\"M" + px(x1) + " " + px(y1) + "L" + px(x2) + " " + px(y2) + "\" stroke=\"" +
         colour + "\" stroke-width=\"" + width + "\" fill=\"none\"/>\n";
}

std::string box(double x, double y, double width, double height) {
  return "<rect x=\"" + px(x) + "\" y=\"" + px(y) + "\" width=\"" + px(width) + "\" height=\"" +
         px(height) + "\" fill=\"none\" stroke=\"" + ink + "\" stroke-width=\"0.8\"/>\n";
}

std::string hertz(double frequency_hz) {
  return frequency_hz < 1000.0 ? fixed(frequency_hz, 0) : fixed(frequency_hz / 1000.0, 0) + "k";
}

std::string svg_head(double width, double height, double font_px) {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + px(width) + " " + px(height) +
         "\" width=\"" + px(width) + "\" height=\"" + px(height) +
         "\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"" + px(font_px) +
         "\" fill=\"" + ink + "\">\n";
}

}  // namespace ressort::commands
