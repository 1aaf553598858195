#include "tendril/io/text.hpp"

#include "tendril/model/scene.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace tendril {
namespace {

/// Bytes of the character at a place, or 0 where there is none that may be shown. UTF-8 as in RFC 3629, section 4.
int characterLength(const std::string &text, std::size_t at) {
  auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const unsigned first = byte(at), second = byte(at + 1);
  if (first < 0x80) return (first >= 0x20 && first != 0x7F) || first == '\n' || first == '\t';
  const int length = first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
  for (int k = 1; k < length; ++k)
    if ((byte(at + std::size_t(k)) & 0xC0) != 0x80) return 0;
  const bool control = first == 0xC2 && second < 0xA0,
             longer = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90),
             surrogate = first == 0xED && second > 0x9F, beyond = first == 0xF4 && second > 0x8F;
  return control || longer || surrogate || beyond ? 0 : length;
}

/// Characters that turn the order of others around them (UAX 9: U+202A to U+202E, U+2066 to U+2069): lines would show
/// what they do not say.
bool reorders(const std::string &text, std::size_t at) {
  const std::string head = text.substr(at, 2);
  const unsigned last = at + 2 < text.size() ? static_cast<unsigned char>(text[at + 2]) : 0u;
  return (head == "\xE2\x80" && last >= 0xAA && last <= 0xAE) || (head == "\xE2\x81" && last >= 0xA6 && last <= 0xA9);
}

std::string inHex(char c) {
  constexpr const char *digits = "0123456789ABCDEF";
  const auto byte = static_cast<unsigned char>(c);
  return {digits[byte >> 4], digits[byte & 15]};
}

} // namespace

std::string readBytes(const std::string &path, const std::string &missing, std::size_t most) {
  constexpr std::string_view mark = "\xEF\xBB\xBF";
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SceneError(path + missing);
  std::string text;
  constexpr std::size_t piece = 1 << 20; // pipes and devices tell no size
  for (std::size_t size = 0; file && size <= most; size = text.size()) {
    text.resize(size + piece);
    file.read(text.data() + size, piece);
    text.resize(size + std::size_t(file.gcount()));
  }
  if (text.size() > most)
    throw SceneError(path + ": has more than " + std::to_string(most) +
                     " bytes, which are not read; write points into polyline files");
  return text.starts_with(mark) ? text.substr(mark.size()) : text;
}

std::string readText(const std::string &path, const std::string &missing) {
  constexpr std::size_t most = 64'000'000;
  std::string text = readBytes(path, missing, most);
  for (std::size_t k = 0; k < text.size();) {
    const int length = text[k] == '\r' ? 1 : characterLength(text, k);
    if (length == 0)
      throw SceneError(path + ":" +
                       std::to_string(1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(k), '\n')) +
                       ": the byte 0x" + inHex(text[k]) + " is no text; save the file as UTF-8");
    k += std::size_t(length);
  }
  return text;
}

std::string printable(const std::string &text) {
  std::string out;
  for (std::size_t k = 0; k < text.size();) {
    const int length = reorders(text, k) ? 0 : characterLength(text, k);
    if (length == 0)
      out += "\\x" + inHex(text[k]);
    else
      out.append(text, k, std::size_t(length));
    k += std::size_t(std::max(length, 1));
  }
  return out;
}

std::string inOneLine(std::string text) {
  for (char &c : text)
    if (static_cast<unsigned char>(c) < ' ') c = '?';
  return text;
}

std::string excerpt(const std::string &text) {
  constexpr std::size_t most = 60;
  return "'" + (text.size() > most ? text.substr(0, most) + "..." : text) + "'";
}

std::string extensionOf(const std::string &path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return extension;
}

} // namespace tendril
