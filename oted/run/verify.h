#pragma once
/// Which files of a run directory are whole, by what its records say of themselves and of each other.

#include <filesystem>
#include <string>
#include <vector>

namespace oted {

enum class FileState {
  kWhole,     ///< as it was written
  kDamaged,   ///< not as it was written, or from another file than the one that is there
  kMissing,   ///< named by a record, and not there
  kUnproven,  ///< no record speaks for it: work that is not complete, or of another version
  kLeftOver,  ///< a temporary file of a program that died; the next command removes it
};

struct VerifiedFile {
  std::filesystem::path path;  ///< relative to the run directory
  FileState state = FileState::kWhole;
  std::string note;            ///< why, for one that is not whole
  bool note_is_error = false;  ///< the note is a whole error, with the file and a remedy
};

struct Verification {
  std::vector<VerifiedFile> files;  ///< by path
  bool in_use = false;              ///< some program works there now
  bool is_whole() const;            ///< nothing damaged or missing
};

/// Reads every file of the run and changes none. @throws UsageError unless it is a run directory
Verification VerifyRun(const std::filesystem::path& run_directory);

/// For what reads a run without making it: whether its records and run.toml are as they were written and fit each
/// other. Their other files are not read. @throws DataError that names the first that is not
void CheckRecords(const std::filesystem::path& run_directory);

}  // namespace oted
