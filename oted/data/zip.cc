#include "oted/data/zip.h"

#include <fmt/format.h>
#include <zip.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <set>
#include <string_view>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/unpack_budget.h"

namespace oted {
namespace {

constexpr uint64_t kLargestMember = uint64_t{1} << 32;  // that is written
constexpr std::string_view kSeal = "sha256 ";
constexpr size_t kHashSize = 64;  // hexadecimal digits
constexpr size_t kStep = size_t{1} << 20;
constexpr zip_int32_t kLevel = 6;            // zlib's usual one
constexpr zip_uint16_t kFirstDay = 0x0021;   // 1 January 1980, the first day that ZIP knows
constexpr zip_uint32_t kReadable = 0100644;  // a regular file, rw-r--r--
constexpr char kEmpty[] = "PK\5\6";          // what an archive without members begins with
constexpr size_t kEmptySize = 22;

/// Of all that stands before the hash itself.
std::string SealOver(const std::string& bytes) {
  return Sha256(std::string_view(bytes).substr(0, bytes.size() - kHashSize));
}

struct Closer {
  void operator()(zip_t* archive) const { zip_discard(archive); }
  void operator()(zip_source_t* source) const { zip_source_free(source); }
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};
using Archive = std::unique_ptr<zip_t, Closer>;
using Source = std::unique_ptr<zip_source_t, Closer>;
using OpenMember = std::unique_ptr<zip_file_t, Closer>;

/// Reads one archive.
class ZipReader {
 public:
  ZipReader(const std::string& bytes, const std::string& name) : bytes_(bytes), name_(name) {
    if (!bytes.starts_with("PK\3\4") && !bytes.starts_with(kEmpty)) Fail("is not an .npz archive");
    Source source(zip_source_buffer_create(bytes.data(), bytes.size(), 0, nullptr));
    OTED_CHECK(source != nullptr);
    archive_.reset(zip_open_from_source(source.get(), ZIP_RDONLY | ZIP_CHECKCONS, nullptr));
    if (archive_ == nullptr) FailDamaged();
    source.release();  // the archive's own now
  }

  std::map<std::string, std::string> Members(uint64_t budget) const {
    std::map<std::string, std::string> members;
    if (HasZipSeal(bytes_) && SealOver(bytes_) != bytes_.substr(bytes_.size() - kHashSize)) FailDamaged();
    CheckBudget(budget);
    uint64_t packed = 0;
    const zip_int64_t n = zip_get_num_entries(archive_.get(), 0);
    for (zip_uint64_t i = 0; i < static_cast<zip_uint64_t>(n); ++i) {
      zip_stat_t member;
      if (zip_stat_index(archive_.get(), i, ZIP_FL_ENC_RAW, &member) != 0) FailDamaged();
      // Members that share bytes are how a small archive claims a huge content.
      packed += std::min<uint64_t>(member.comp_size, bytes_.size() + 1);
      if (packed > bytes_.size()) FailDamaged();
      if (members.contains(member.name)) Fail(fmt::format("holds '{}' twice", member.name));
      members[member.name] = Content(member);
    }
    return members;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw DataError(fmt::format("'{}' {}; save it again with numpy.savez", name_, what));
  }
  [[noreturn]] void FailDamaged() const { Fail("is a truncated or damaged .npz archive"); }

  /// Of what the members claim: none gives more than that.
  void CheckBudget(uint64_t budget) const {
    uint64_t claimed = 0;
    const zip_int64_t n = zip_get_num_entries(archive_.get(), 0);
    for (zip_uint64_t i = 0; i < static_cast<zip_uint64_t>(n); ++i) {
      zip_stat_t member;
      if (zip_stat_index(archive_.get(), i, ZIP_FL_ENC_RAW, &member) != 0) FailDamaged();
      claimed += std::min<uint64_t>(member.size, budget + 1);
      if (claimed > budget) {
        throw DataError(
            fmt::format("'{}' unpacks to far more than its size ({} MiB and more); if that is right, save it without "
                        "compression, with numpy.savez",
                        name_, budget >> 20));
      }
    }
  }

  /// Grows with what comes out, so that a member that only claims a size gets no memory for it.
  std::string Content(const zip_stat_t& member) const {
    if (member.encryption_method != ZIP_EM_NONE) Fail(fmt::format("holds the encrypted member '{}'", member.name));
    if (member.comp_method != ZIP_CM_STORE && member.comp_method != ZIP_CM_DEFLATE) {
      Fail(fmt::format("holds '{}', packed with ZIP method {}, wanted stored or deflated", member.name,
                       member.comp_method));
    }
    const OpenMember file(zip_fopen_index(archive_.get(), member.index, 0));
    if (file == nullptr) FailDamaged();
    std::string content;
    size_t filled = 0;
    for (;;) {
      // One byte more than claimed, so that a stream that goes on is seen.
      content.resize(std::min<size_t>(member.size + 1, std::max(kStep, 2 * filled)));
      const zip_int64_t n = zip_fread(file.get(), content.data() + filled, content.size() - filled);
      if (n < 0) FailDamaged();  // its CRC-32 included
      filled += static_cast<size_t>(n);
      if (n == 0 || filled > member.size) break;
    }
    if (filled != member.size) FailDamaged();
    content.resize(filled);
    return content;
  }

  const std::string& bytes_;
  const std::string& name_;
  Archive archive_;
};

void AddMember(zip_t* archive, const std::string& name, const std::string& content, ZipMethod method) {
  if (content.size() >= kLargestMember) {
    throw DataError(fmt::format("'{}' has {} bytes, too many for .npz; write .hdf5", name, content.size()));
  }
  Source source(zip_source_buffer(archive, content.data(), content.size(), 0));
  OTED_CHECK(source != nullptr);
  const zip_int64_t added = zip_file_add(archive, name.c_str(), source.get(), ZIP_FL_ENC_UTF_8);
  if (added < 0) {
    throw DataError(fmt::format("'{}' cannot be a name in .npz: {}; use another", name, zip_strerror(archive)));
  }
  source.release();
  const zip_uint64_t index = static_cast<zip_uint64_t>(added);
  const zip_int32_t how = method == ZipMethod::kStored ? ZIP_CM_STORE : ZIP_CM_DEFLATE;
  OTED_CHECK(zip_set_file_compression(archive, index, how, kLevel) == 0);
  OTED_CHECK(zip_file_set_dostime(archive, index, 0, kFirstDay, 0) == 0);
  OTED_CHECK(zip_file_set_external_attributes(archive, index, 0, ZIP_OPSYS_UNIX, kReadable << 16) == 0);
}

}  // namespace

std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors) {
  return ParseZip(bytes, name_in_errors, UnpackBudget(bytes.size()));
}

std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors,
                                            uint64_t budget) {
  return ZipReader(bytes, name_in_errors).Members(budget);
}

bool HasZipSeal(const std::string& bytes) {
  const size_t size = kSeal.size() + kHashSize;
  return bytes.size() > size && std::string_view(bytes).substr(bytes.size() - size).starts_with(kSeal);
}

namespace {

/// @param stored  members that are not deflated
std::string Archived(const std::map<std::string, std::string>& members, const std::set<std::string>& stored) {
  // libzip removes an archive without members instead of writing it.
  if (members.empty()) return kEmpty + std::string(kEmptySize - (sizeof kEmpty - 1), '\0');
  const Source buffer(zip_source_buffer_create(nullptr, 0, 0, nullptr));
  OTED_CHECK(buffer != nullptr);
  zip_source_keep(buffer.get());  // for the archive, which gives its own share back
  Archive archive(zip_open_from_source(buffer.get(), ZIP_TRUNCATE, nullptr));
  OTED_CHECK(archive != nullptr);
  for (const auto& [name, content] : members) {
    AddMember(archive.get(), name, content, stored.contains(name) ? ZipMethod::kStored : ZipMethod::kDeflated);
  }
  const std::string room = std::string(kSeal) + std::string(kHashSize, '0');
  OTED_CHECK(zip_set_archive_comment(archive.get(), room.data(), static_cast<zip_uint16_t>(room.size())) == 0);
  OTED_CHECK(zip_close(archive.get()) == 0);
  archive.release();

  zip_stat_t whole;
  OTED_CHECK(zip_source_open(buffer.get()) == 0 && zip_source_stat(buffer.get(), &whole) == 0);
  std::string bytes(whole.size, '\0');
  OTED_CHECK(zip_source_read(buffer.get(), bytes.data(), bytes.size()) == static_cast<zip_int64_t>(bytes.size()));
  zip_source_close(buffer.get());
  OTED_CHECK(HasZipSeal(bytes));
  bytes.replace(bytes.size() - kHashSize, kHashSize, SealOver(bytes));
  return bytes;
}

/// The smallest member that makes the archive `missing` bytes larger where it is stored, else the largest; null where
/// all are stored.
const std::string* NextToStore(const std::map<std::string, std::string>& members, const std::set<std::string>& stored,
                               uint64_t missing) {
  const std::pair<const std::string, std::string>* best = nullptr;
  for (const auto& member : members) {
    if (stored.contains(member.first)) continue;
    const bool is_enough = member.second.size() >= missing;
    const bool was_enough = best != nullptr && best->second.size() >= missing;
    const bool is_smaller = best != nullptr && member.second.size() < best->second.size();
    if (best == nullptr || (is_enough != was_enough ? is_enough : is_enough == is_smaller)) best = &member;
  }
  return best == nullptr ? nullptr : &best->first;
}

}  // namespace

std::string ZipBytes(const std::map<std::string, std::string>& members, ZipMethod method) {
  std::set<std::string> stored;
  uint64_t size = 0;
  for (const auto& [name, content] : members) {
    size += content.size();
    if (method == ZipMethod::kStored) stored.insert(name);
  }
  for (;;) {
    std::string bytes = Archived(members, stored);
    const uint64_t budget = UnpackBudget(bytes.size());
    if (size <= budget) return bytes;
    const std::string* next = NextToStore(members, stored, (size - budget) / kUnpackRatio + 1);
    OTED_CHECK(next != nullptr);  // what is stored fits
    stored.insert(*next);
  }
}

}  // namespace oted
