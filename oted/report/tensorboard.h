#pragma once
/// TensorBoard event files: protobuf `Event` messages in TFRecord framing.
/// A record is: length (u64), masked crc32c of the length, data, masked crc32c of the data; little-endian.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "oted/base/files.h"

namespace oted {

/// CRC-32C (Castagnoli, reflected, polynomial 0x1EDC6F41), as in RFC 3720.
uint32_t Crc32c(std::string_view bytes);

/// `data` as one TFRecord.
std::string TfRecord(std::string_view data);

/// Writes scalars to a new file `events.out.tfevents.<seconds>.<host>.<process>.<n>`; not thread-safe.
class EventFileWriter {
 public:
  /// Creates `folder` when it is missing. @throws DataError when the file cannot be created.
  explicit EventFileWriter(const std::filesystem::path& folder);

  /// Appends one scalar (stored as a 32-bit float, as TensorBoard's own `simple_value`) and hands it to the system.
  /// @throws DataError when the disk takes no more.
  void Scalar(std::string_view tag, int64_t step, double value);

  const std::filesystem::path& path() const { return path_; }

 private:
  void Append(std::string_view event);

  std::filesystem::path path_;
  std::optional<OpenFile> file_;
};

}  // namespace oted
