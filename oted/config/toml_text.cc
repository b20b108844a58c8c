#include "oted/config/toml_text.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr int kMostParts = 64;  // of a dotted name: the parser goes one call deeper for each

/// Where the string that begins at `begin` ends: behind its closing quotes, or at what the parser will find fault with
/// (the end of the line of a single-line string, the end of the text).
size_t EndOfString(std::string_view text, size_t begin) {
  const char quote = text[begin];
  const std::string three(3, quote);
  const bool many_lines = text.substr(begin, 3) == three;
  size_t i = begin + (many_lines ? 3 : 1);
  while (i < text.size()) {
    if (quote == '"' && text[i] == '\\') {
      i += 2;
    } else if (many_lines && text.substr(i, 3) == three) {
      i += 3;
      // Up to two quotes may stand before the closing ones.
      while (i < text.size() && text[i] == quote) ++i;
      return i;
    } else if (!many_lines && text[i] == quote) {
      return i + 1;
    } else if (!many_lines && text[i] == '\n') {
      return i;
    } else {
      ++i;
    }
  }
  return text.size();
}

}  // namespace

void CheckTomlCharacters(std::string_view text, const std::string& file_name) {
  size_t i = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  int n_dots = 0;  // of what may be one name
  const auto line = [&] { return 1 + std::count(text.begin(), text.begin() + static_cast<ptrdiff_t>(i), '\n'); };
  while (i < text.size()) {
    const char c = text[i];
    if (c == '.' && ++n_dots >= kMostParts) {
      throw UsageError(fmt::format("{}:{}: a name has more than {} parts", file_name, line(), kMostParts));
    }
    if (std::string_view("\n=,[]{}").find(c) != std::string_view::npos) n_dots = 0;
    if (c == '"' || c == '\'') {
      i = EndOfString(text, i);
    } else if (c == '#') {
      i = std::min(text.find('\n', i), text.size());
    } else if (static_cast<unsigned char>(c) >= 0x80) {
      throw UsageError(
          fmt::format("{}:{}: a character beyond ASCII stands outside of quotes; put names that need it into quotes",
                      file_name, line()));
    } else {
      ++i;
    }
  }
}

}  // namespace oted
