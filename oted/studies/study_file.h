#pragma once
/// The records of a study: JSON lines, one for each cell.

#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

/// OUT.jsonl, beside the folder OUT that holds the runs of the study. Each line is an object with the name of its
/// "cell"; lines stand in the order of these names. For several threads and processes at once.
class StudyFile {
 public:
  explicit StudyFile(const std::filesystem::path& out);

  /// The record of `cell` without its name, null where there is none. @throws DataError where the file is damaged
  nlohmann::json Find(const std::string& cell) const;
  /// All records by cell, without their names. @throws DataError likewise
  std::map<std::string, nlohmann::json> All() const;
  /// Adds the record of `cell` or replaces it. The file appears whole, and what others add meanwhile stays.
  void Put(const std::string& cell, nlohmann::json record) const;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace oted
