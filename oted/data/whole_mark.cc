#include "oted/data/whole_mark.h"

#include <fmt/format.h>
#include <zlib.h>

#include <charconv>

namespace oted {
namespace {

constexpr size_t kMarkSize = 26;

}  // namespace

uint32_t Checksum(uint32_t before, std::string_view bytes) {
  return static_cast<uint32_t>(
      ::crc32(before, reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<unsigned>(bytes.size())));
}

std::string WholeMark::ToText() const { return fmt::format("{:016x} {:08x}\n", size, checksum); }

std::optional<WholeMark> WholeMark::FromText(std::string_view text) {
  WholeMark mark;
  const char *size = text.data(), *checksum = size + 17;
  if (text.size() != kMarkSize || std::from_chars(size, size + 16, mark.size, 16).ec != std::errc() ||
      std::from_chars(checksum, checksum + 8, mark.checksum, 16).ec != std::errc()) {
    return std::nullopt;
  }
  return mark;
}

bool WholeMark::Fits(std::string_view text) const {
  return size <= text.size() && Checksum(0, text.substr(0, size)) == checksum;
}

}  // namespace oted
