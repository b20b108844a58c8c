#pragma once
/// Every reader of files from outside, in families that `make fuzz` searches one at a time. A family's input is a file
/// as a user would hand it over: each of its readers reads the same bytes under a name of its own.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace oted {

struct FuzzReader {
  std::string file;  ///< where the bytes go, below the working folder
  /// Reads it as the program does; `folder` is the working folder.
  std::function<void(const std::filesystem::path& folder)> read;
  /// One of these stands in each error, where that is not `file`: the dataset that it is part of.
  std::vector<std::string> names = {};
  bool in_child = false;  ///< the file is read in a child process
};

/// Changes bytes at random.
using Mutator = std::function<std::string(const std::string&)>;

struct FuzzFamily {
  std::string name;
  std::vector<std::string> seeds = {};  ///< whole files, in the forms that are written today
  std::vector<FuzzReader> readers = {};
  /// Changes what lies behind a checksum and renews that, where there is one; random bytes would never pass it.
  /// Throws DataError where the bytes are not whole.
  std::function<std::string(const std::string& bytes, uint64_t random, const Mutator& mutate)> mutate_inside = {};
};

/// All families; makes their seeds, and whole the folders around their files, in `folder`.
std::vector<FuzzFamily> FuzzFamilies(const std::filesystem::path& folder);

/// What families.cc puts together.
void AddDataFamilies(const std::filesystem::path& folder, std::vector<FuzzFamily>& families);
void AddModelFamilies(const std::filesystem::path& folder, std::vector<FuzzFamily>& families);
void AddRecordFamilies(const std::filesystem::path& folder, std::vector<FuzzFamily>& families);

/// mutate_inside of zip archives: one member.
std::string MutateZipMember(const std::string& bytes, uint64_t random, const Mutator& mutate);

enum class FuzzOutcome {
  kRead,
  kRefused,  ///< by a DataError or UsageError of one line that names the file
  kFailed,   ///< anything else
};

struct FuzzResult {
  FuzzOutcome outcome = FuzzOutcome::kFailed;
  std::string message = {};  ///< the error
};

/// What the reader makes of the bytes.
FuzzResult ReadBytes(const FuzzReader& reader, const std::filesystem::path& folder, const std::string& bytes);

}  // namespace oted
