#pragma once
/// \file text.hpp
/// Text from files, and text for terminals.

#include <string>

namespace tendril {

/// A file of text in UTF-8, without its byte order mark.
/// \param missing what to say behind the path where it cannot be opened
/// \throws SceneError: cannot be opened, is larger than 64 MB, or with the line of the first byte that is no text
std::string readText(const std::string &path, const std::string &missing);

/// The bytes of a file, a pipe or a device, without a byte order mark of UTF-8. \throws SceneError: cannot be opened,
/// or has more than `most`
std::string readBytes(const std::string &path, const std::string &missing, std::size_t most);

/// What may go to a terminal: control characters but newline and tab, and bytes that are no UTF-8, as \xNN.
std::string printable(const std::string &text);

/// Control characters, newlines too, as question marks.
std::string inOneLine(std::string text);

/// Of a file, in lower case: `.obj`.
std::string extensionOf(const std::string &path);

/// In quotes, with at most 60 bytes.
std::string excerpt(const std::string &text);

} // namespace tendril
