#pragma once
/// The curves of one unit of work, as text: `curves.csv` with the header `step,key,value`, one scalar per row.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace oted {

/// (step, value) in ascending order of step, each step once.
using Curve = std::vector<std::pair<int64_t, double>>;

struct Curves {
  std::map<std::string, Curve> by_key;
  /// The curve of `key`, empty when there is none.
  const Curve& At(const std::string& key) const;
};

/// Appends to a curves.csv, which it starts when missing. A row that an interruption left unfinished at the file's end
/// is removed first.
class CurvesWriter {
 public:
  /// @throws DataError when the file cannot be written, or is no curves.csv.
  explicit CurvesWriter(const std::filesystem::path& path);
  /// Appends one row and hands it to the system. @throws DataError when the disk takes no more.
  void Append(int64_t step, std::string_view key, double value);

 private:
  std::filesystem::path path_;
  std::ofstream file_;
};

/// A unit that went on from a checkpoint writes the steps behind it again: the last row of each (step, key) counts. A
/// last row without its end of line is being written, or was cut off, and is left out.
/// @throws DataError when the file cannot be read, or a row is not `step,key,value`.
Curves ReadCurves(const std::filesystem::path& path);

}  // namespace oted
