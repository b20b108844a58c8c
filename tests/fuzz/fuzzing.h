#pragma once
/// Damaged files for every reader of the project: seed files, deterministic mutations, and what a reader may do with
/// them.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "oted/base/rng.h"

namespace oted {

/// One kind of file, with good examples of it.
struct FuzzFormat {
  std::string name;                ///< "d4rl-v2"
  std::string file;                ///< where a mutant goes, below the working folder
  std::vector<std::string> seeds;  ///< contents
  bool is_text = false;
  /// Packs a mutated content into the file's container; empty: there is none. For half of the mutants: damage behind a
  /// checksum would otherwise never be reached.
  std::function<std::string(const std::string&)> pack;
  std::vector<std::string> inner_seeds;  ///< what `pack` takes
  /// Reads the file as the program does; `folder` is the working folder.
  std::function<void(const std::filesystem::path& folder)> read;
  /// One of these stands in each error: the file, or the dataset that it is part of.
  std::vector<std::string> names;
};

/// All formats; makes their seeds, and whole the folders around them, in `folder`.
std::vector<FuzzFormat> FuzzFormats(const std::filesystem::path& folder);

/// `n` changes: flipped bits, other bytes, truncation, blocks inserted, removed, copied within and from another
/// example, 2, 4 or 8 bytes overwritten with a length that tempts (0, -1, 2^31, the file's size, ...), and for text
/// stray tokens.
std::string Mutate(const std::string& content, const std::string& other, bool is_text, Rng& rng);

/// The mutant of this key: its bytes.
std::string MakeMutant(const FuzzFormat& format, RngKey key);

enum class FuzzOutcome { kRead, kRefused, kChildDied, kFailed };

struct FuzzResult {
  FuzzOutcome outcome = FuzzOutcome::kFailed;
  std::string message;  ///< the error
};

/// Writes the mutant and reads it. Refused: a DataError or UsageError of one line that names the file. ChildDied: the
/// same, of an HDF5 file whose child process died or ran past a limit. Failed: anything else that can be caught.
FuzzResult ReadMutant(const FuzzFormat& format, const std::filesystem::path& folder, const std::string& mutant);

}  // namespace oted
