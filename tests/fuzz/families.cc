#include "tests/fuzz/families.h"

#include <algorithm>
#include <fstream>

#include "oted/base/error.h"
#include "oted/data/zip.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

/// A child that a sanitizer ended, by the exit code that scripts/fuzz.py and the tests ask for.
constexpr const char* kSanitizerInChild = "reading it broke off (exit status 99)";

FuzzResult Judge(const FuzzReader& reader, const std::string& message) {
  const bool named =
      message.find(reader.file) != std::string::npos || std::ranges::any_of(reader.names, [&](const std::string& name) {
        return message.find(name) != std::string::npos;
      });
  if (!named) return {FuzzOutcome::kFailed, "the error does not name the file: " + message};
  if (message.find('\n') != std::string::npos) return {FuzzOutcome::kFailed, "the error is not one line: " + message};
  if (reader.in_child && message.find(kSanitizerInChild) != std::string::npos) return {FuzzOutcome::kFailed, message};
  return {FuzzOutcome::kRefused, message};
}

}  // namespace

std::vector<FuzzFamily> FuzzFamilies(const fs::path& folder) {
  fs::create_directories(folder);
  std::vector<FuzzFamily> families;
  AddDataFamilies(folder, families);
  AddModelFamilies(folder, families);
  AddRecordFamilies(folder, families);
  return families;
}

std::string MutateZipMember(const std::string& bytes, uint64_t random, const Mutator& mutate) {
  std::map<std::string, std::string> members = ParseZip(bytes, "archive");
  if (members.empty()) return mutate(bytes);
  std::string& content = std::next(members.begin(), static_cast<int>(random % members.size()))->second;
  content = mutate(content);
  return ZipBytes(members);
}

FuzzResult ReadBytes(const FuzzReader& reader, const fs::path& folder, const std::string& bytes) {
  // Not atomically: it need not survive anything, and waiting for the disk would be most of the time.
  std::ofstream(folder / reader.file, std::ios::binary) << bytes;
  try {
    reader.read(folder);
    return {FuzzOutcome::kRead};
  } catch (const DataError& e) {
    return Judge(reader, e.what());
  } catch (const UsageError& e) {
    return Judge(reader, e.what());
  } catch (const std::exception& e) {
    return {FuzzOutcome::kFailed, std::string("another exception: ") + e.what()};
  }
}

}  // namespace oted
