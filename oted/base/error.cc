#include "oted/base/error.h"

#include <fmt/format.h>

namespace oted {
namespace {

/// Length of the UTF-8 character that `text` begins with; 0 when it begins with none.
size_t CharacterLength(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const size_t length = first >= 0xF0 && first < 0xF5 ? 4 : first >= 0xE0 && first < 0xF0 ? 3 : first >= 0xC2 ? 2 : 0;
  if (length == 0 || first >= 0xF5 || text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  // Overlong forms, surrogates, and beyond U+10FFFF.
  if ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) >= 0xA0) || (first == 0xF0 && byte(1) < 0x90) ||
      (first == 0xF4 && byte(1) >= 0x90)) {
    return 0;
  }
  return length;
}

}  // namespace

std::string Printable(std::string_view text) {
  std::string printable;
  while (!text.empty()) {
    const size_t length = CharacterLength(text);
    const unsigned char first = static_cast<unsigned char>(text[0]);
    // U+0080 to U+009F are control characters as well.
    const bool is_control =
        first < 0x20 || first == 0x7F || (length == 2 && first == 0xC2 && static_cast<unsigned char>(text[1]) < 0xA0);
    if (first == '\n' || first == '\r') {
      printable += ' ';
    } else if (length == 0 || is_control) {
      printable += '?';
    } else {
      printable += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  // The remedy stands at the end.
  constexpr size_t kBegin = 3000, kEnd = 1000;
  if (printable.size() <= kBegin + kEnd) return printable;
  const auto at_character = [&](size_t i) {
    while ((static_cast<unsigned char>(printable[i]) & 0xC0) == 0x80) --i;
    return i;
  };
  return printable.substr(0, at_character(kBegin)) + " ... " + printable.substr(at_character(printable.size() - kEnd));
}

}  // namespace oted

namespace oted::internal {

void CheckFailed(const char* condition, const char* file, int line) {
  throw InternalError(fmt::format("internal error: {} does not hold ({}:{}); please report it", condition, file, line));
}

}  // namespace oted::internal
