#include "oted/data/zip.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string_view>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr uint32_t kLocalSignature = 0x04034b50;
constexpr uint32_t kDirectorySignature = 0x02014b50;
constexpr uint32_t kEndSignature = 0x06054b50;
constexpr uint32_t kEnd64Signature = 0x06064b50;
constexpr uint32_t kLocator64Signature = 0x07064b50;
constexpr size_t kLocalSize = 30;
constexpr size_t kDirectorySize = 46;
constexpr size_t kEndSize = 22;
constexpr size_t kEnd64Size = 56;
constexpr size_t kLocator64Size = 20;
constexpr uint32_t kIn64 = 0xFFFFFFFF;  // "the value is in the zip64 extra field"
constexpr uint64_t kMaxInflated = uint64_t{1} << 32;
constexpr size_t kStep = size_t{1} << 20;

struct Member {
  std::string name;
  unsigned flags = 0;
  unsigned method = 0;
  uint32_t crc = 0;
  uint64_t compressed = 0;
  uint64_t size = 0;
  uint64_t offset = 0;
};

class ZipParser {
 public:
  ZipParser(std::string_view bytes, const std::string& archive) : bytes_(bytes), archive_(archive) {}

  std::map<std::string, std::string> Parse() {
    FindDirectory();
    std::map<std::string, std::string> members;
    uint64_t total_compressed = 0;
    for (uint64_t i = 0; i < n_members_; ++i) {
      const Member member = NextMember();
      total_compressed += member.compressed;
      // Members that share bytes are how a small archive claims a huge content.
      if (member.compressed > bytes_.size() || total_compressed > bytes_.size()) FailDamaged();
      if (members.contains(member.name)) Fail(fmt::format("holds '{}' twice", member.name));
      members[member.name] = Content(member);
    }
    return members;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw DataError(fmt::format("'{}' {}; save it again with numpy.savez", archive_, what));
  }
  [[noreturn]] void FailDamaged() const { Fail("is a truncated or damaged .npz archive"); }

  /// Little-endian unsigned number of `size` bytes.
  uint64_t Number(uint64_t at, size_t size) const {
    if (at > bytes_.size() || size > bytes_.size() - at) FailDamaged();
    uint64_t value = 0;
    for (size_t i = size; i > 0; --i) value = value << 8 | static_cast<unsigned char>(bytes_[at + i - 1]);
    return value;
  }
  uint16_t U16(uint64_t at) const { return static_cast<uint16_t>(Number(at, 2)); }
  uint32_t U32(uint64_t at) const { return static_cast<uint32_t>(Number(at, 4)); }
  uint64_t U64(uint64_t at) const { return Number(at, 8); }

  void FindDirectory() {
    if (bytes_.size() < 4 || (U32(0) != kLocalSignature && U32(0) != kEndSignature)) {
      Fail("is not an .npz archive");
    }
    if (bytes_.size() < kEndSize) FailDamaged();
    // The end record is last but for a comment of up to 65,535 bytes.
    const size_t last = bytes_.size() - kEndSize;
    const size_t first = last > 0xFFFF ? last - 0xFFFF : 0;
    size_t end = last;
    while (U32(end) != kEndSignature || end + kEndSize + U16(end + 20) != bytes_.size()) {
      if (end == first) FailDamaged();
      --end;
    }
    n_members_ = U16(end + 10);
    uint64_t size = U32(end + 12);
    at_ = U32(end + 16);
    directory_end_ = end;
    if (end >= kLocator64Size && U32(end - kLocator64Size) == kLocator64Signature) {
      const uint64_t end64 = U64(end - kLocator64Size + 8);
      if (end64 > bytes_.size() || bytes_.size() - end64 < kEnd64Size || U32(end64) != kEnd64Signature) FailDamaged();
      n_members_ = U64(end64 + 32);
      size = U64(end64 + 40);
      at_ = U64(end64 + 48);
      directory_end_ = end64;
    }
    if (at_ > directory_end_ || size != directory_end_ - at_ || n_members_ > size / kDirectorySize) FailDamaged();
  }

  Member NextMember() {
    const uint64_t at = at_;
    if (at > directory_end_ || directory_end_ - at < kDirectorySize || U32(at) != kDirectorySignature) FailDamaged();
    Member member;
    member.flags = U16(at + 8);
    member.method = U16(at + 10);
    member.crc = U32(at + 16);
    member.compressed = U32(at + 20);
    member.size = U32(at + 24);
    member.offset = U32(at + 42);
    const uint64_t name_size = U16(at + 28);
    const uint64_t extra_size = U16(at + 30);
    const uint64_t end = at + kDirectorySize + name_size + extra_size + U16(at + 32);
    if (end > directory_end_) FailDamaged();
    member.name = std::string(bytes_.substr(at + kDirectorySize, name_size));
    ReadZip64(at + kDirectorySize + name_size, extra_size, member);
    at_ = end;
    return member;
  }

  /// Replaces the values that did not fit in 32 bits by those of the zip64 extra field.
  void ReadZip64(uint64_t at, uint64_t size, Member& member) const {
    const uint64_t end = at + size;
    while (end - at >= 4) {
      const uint16_t id = U16(at);
      const uint64_t field_end = at + 4 + U16(at + 2);
      if (field_end > end) FailDamaged();
      uint64_t value_at = at + 4;
      if (id == 1) {
        for (uint64_t* value : {&member.size, &member.compressed, &member.offset}) {
          if (*value != kIn64) continue;
          if (field_end - value_at < 8) FailDamaged();
          *value = U64(value_at);
          value_at += 8;
        }
      }
      at = field_end;
    }
  }

  std::string Content(const Member& member) const {
    if ((member.flags & 1u) != 0) Fail(fmt::format("holds the encrypted member '{}'", member.name));
    if (member.offset > bytes_.size() || bytes_.size() - member.offset < kLocalSize) FailDamaged();
    if (U32(member.offset) != kLocalSignature) FailDamaged();
    const uint64_t begin = member.offset + kLocalSize + U16(member.offset + 26) + U16(member.offset + 28);
    if (begin > directory_end_ || member.compressed > directory_end_ - begin) FailDamaged();
    const std::string_view stored = bytes_.substr(begin, member.compressed);
    std::string content;
    if (member.method == 0) {
      if (member.size != member.compressed) FailDamaged();
      content = std::string(stored);
    } else if (member.method == 8) {
      content = Inflate(stored, member);
    } else {
      Fail(fmt::format("holds '{}', packed with ZIP method {}, wanted stored or deflated", member.name, member.method));
    }
    if (crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()) != member.crc) FailDamaged();
    return content;
  }

  /// Grows the output with what comes out, so that a member that only claims a size gets no memory for it.
  std::string Inflate(std::string_view stored, const Member& member) const {
    if (member.size > kMaxInflated) Fail(fmt::format("holds '{}' of more than 4 GiB", member.name));
    z_stream stream{};
    OTED_CHECK(inflateInit2(&stream, -MAX_WBITS) == Z_OK);
    const struct Ender {
      z_stream* stream;
      ~Ender() { inflateEnd(stream); }
    } ender{&stream};
    std::string content;
    size_t filled = 0;
    int status = Z_OK;
    while (status == Z_OK) {
      if (stream.avail_in == 0) {
        const size_t n = std::min<size_t>(stored.size(), kStep);
        stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stored.data()));
        stream.avail_in = static_cast<uInt>(n);
        stored.remove_prefix(n);
      }
      if (filled == content.size()) {
        // One byte more than claimed, so that a stream that goes on is seen.
        content.resize(std::min<size_t>(member.size + 1, std::max(kStep, 2 * filled)));
      }
      const size_t room = std::min<size_t>(content.size() - filled, std::numeric_limits<int>::max());
      stream.next_out = reinterpret_cast<Bytef*>(content.data() + filled);
      stream.avail_out = static_cast<uInt>(room);
      status = inflate(&stream, Z_NO_FLUSH);
      filled += room - stream.avail_out;
      if (filled > member.size) FailDamaged();
    }
    if (status != Z_STREAM_END || filled != member.size) FailDamaged();
    content.resize(filled);
    return content;
  }

  std::string_view bytes_;
  const std::string& archive_;
  uint64_t at_ = 0;  // of the directory's next entry
  uint64_t directory_end_ = 0;
  uint64_t n_members_ = 0;
};

void Put(std::string& to, uint64_t value, size_t size) {
  for (size_t i = 0; i < size; ++i) to += static_cast<char>(value >> (8 * i) & 0xFF);
}

std::string Deflate(std::string_view content) {
  z_stream stream{};
  OTED_CHECK(deflateInit2(&stream, 6, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) == Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
  stream.avail_in = static_cast<uInt>(content.size());
  std::string packed;
  std::string block(kStep, '\0');
  int status = Z_OK;
  while (status == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = deflate(&stream, Z_FINISH);
    packed.append(block, 0, block.size() - stream.avail_out);
  }
  deflateEnd(&stream);
  OTED_CHECK(status == Z_STREAM_END);
  return packed;
}

}  // namespace

std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors) {
  return ZipParser(bytes, name_in_errors).Parse();
}

std::string ZipBytes(const std::map<std::string, std::string>& members) {
  std::string archive;
  std::string directory;
  if (members.size() >= 0xFFFF) throw DataError("an .npz archive holds at most 65,534 arrays; use fewer");
  for (const auto& [name, content] : members) {
    OTED_CHECK(name.size() <= 0xFFFF);
    if (content.size() >= kIn64) {
      throw DataError(fmt::format("'{}' has {} bytes, too many for .npz; write .hdf5", name, content.size()));
    }
    const std::string packed = Deflate(content);
    const bool ascii = std::ranges::all_of(name, [](unsigned char c) { return c < 0x80; });
    std::string common;  // what the local header and the directory share
    Put(common, 20, 2);  // version needed
    Put(common, ascii ? 0 : 1u << 11, 2);
    Put(common, 8, 2);       // deflate
    Put(common, 0, 2);       // 00:00:00
    Put(common, 0x0021, 2);  // 1 January 1980
    Put(common, crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()), 4);
    Put(common, packed.size(), 4);
    Put(common, content.size(), 4);
    Put(common, name.size(), 2);
    Put(common, 0, 2);  // no extra field

    Put(directory, kDirectorySignature, 4);
    Put(directory, 3u << 8 | 20u, 2);  // made on Unix
    directory += common;
    Put(directory, 0, 6);                        // no comment, disk 0, not text
    Put(directory, uint64_t{0100644} << 16, 4);  // a regular file, rw-r--r--
    Put(directory, archive.size(), 4);
    directory += name;

    Put(archive, kLocalSignature, 4);
    archive += common;
    archive += name;
    archive += packed;
    if (archive.size() >= kIn64) throw DataError("the arrays need more than 4 GiB, too much for .npz; write .hdf5");
  }
  const size_t directory_at = archive.size();
  archive += directory;
  Put(archive, kEndSignature, 4);
  Put(archive, 0, 4);  // disk 0
  Put(archive, members.size(), 2);
  Put(archive, members.size(), 2);
  Put(archive, directory.size(), 4);
  Put(archive, directory_at, 4);
  Put(archive, 0, 2);  // no comment
  return archive;
}

}  // namespace oted
