#pragma once
/// How far a file that grows row by row is whole: its size and checksum, kept in a file of its own beside it.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace oted {

struct WholeMark {
  uint64_t size = 0;
  uint32_t checksum = 0;  ///< CRC-32 of so many bytes

  std::string ToText() const;
  static std::optional<WholeMark> FromText(std::string_view text);
  /// Whether `text` begins with what the mark is of.
  bool Fits(std::string_view text) const;
};

/// CRC-32 of bytes behind those whose CRC-32 is `before`; 0: of none.
uint32_t Checksum(uint32_t before, std::string_view bytes);

}  // namespace oted
