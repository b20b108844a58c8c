#include "oted/studies/study_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Cells by name, without their names.
std::map<std::string, json> ReadCells(const fs::path& path) {
  std::map<std::string, json> cells;
  if (!fs::exists(path)) return cells;
  std::istringstream lines(ReadFile(path));
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    json record = json::parse(line, nullptr, false);
    if (!record.is_object() || !record.contains("cell") || !record["cell"].is_string()) {
      throw DataError(
          fmt::format("'{}' line {}: wanted a JSON object with a \"cell\"; remove the line and its cell is "
                      "run again",
                      path.string(), number));
    }
    const std::string name = record["cell"];
    record.erase("cell");
    cells[name] = std::move(record);
  }
  return cells;
}

/// Keeps other processes and threads from replacing the files of a folder meanwhile, and leaves nothing behind.
class FolderLock {
 public:
  explicit FolderLock(const fs::path& folder) : descriptor_(::open(folder.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor_ < 0 || ::flock(descriptor_, LOCK_EX) != 0) {
      const std::string reason = std::strerror(errno);
      if (descriptor_ >= 0) ::close(descriptor_);
      throw DataError(fmt::format("cannot lock '{}': {}", folder.string(), reason));
    }
  }
  ~FolderLock() { ::close(descriptor_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_;
};

}  // namespace

StudyFile::StudyFile(const fs::path& out) {
  path_ = out.lexically_normal();
  if (!path_.has_filename()) path_ = path_.parent_path();
  path_ += ".jsonl";
}

json StudyFile::Find(const std::string& cell) const {
  const std::map<std::string, json> cells = ReadCells(path_);
  const auto found = cells.find(cell);
  return found == cells.end() ? json() : found->second;
}

std::map<std::string, json> StudyFile::All() const { return ReadCells(path_); }

void StudyFile::Put(const std::string& cell, json record) const {
  const fs::path folder = path_.has_parent_path() ? path_.parent_path() : fs::path(".");
  fs::create_directories(folder);
  const FolderLock lock(folder);
  std::map<std::string, json> cells = ReadCells(path_);
  cells[cell] = std::move(record);
  std::string text;
  for (auto& [name, content] : cells) {
    content["cell"] = name;
    text += content.dump() + "\n";
  }
  WriteFileAtomically(path_, text);
}

}  // namespace oted
