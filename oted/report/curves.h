#pragma once
/// The curves of one unit of work, as text: `curves.csv` with the header `step,key,value`, one scalar per row.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "oted/base/files.h"

namespace oted {

/// (step, value) in ascending order of step, each step once.
using Curve = std::vector<std::pair<int64_t, double>>;

struct Curves {
  std::map<std::string, Curve> by_key;
  /// The curve of `key`, empty when there is none.
  const Curve& At(const std::string& key) const;
};

/// Appends to a curves.csv, which it starts when missing. Beside it, checkpoint.curves says how far the file is whole:
/// what an interruption left behind that is cut off. Work that goes on from a checkpoint writes the steps behind it
/// again: a row that is there already is not repeated, so that the file is that of work without a stop.
class CurvesWriter {
 public:
  /// A file that is not whole is kept as curves.csv.damaged and begun anew.
  /// @throws DataError when the file cannot be written, or is no curves.csv.
  /// @param least  a mark (WholeMark) of what the file must begin with, for a checkpoint was written behind it; a file
  /// that does not is not whole, whatever checkpoint.curves says
  explicit CurvesWriter(const std::filesystem::path& path, std::string_view least = "");
  /// Appends one row and hands it to the system. Steps of a key do not descend. @throws DataError when the disk takes
  /// no more.
  void Append(int64_t step, std::string_view key, double value);
  /// Of what the file holds now.
  std::string MarkOfAll() const;
  /// Whether a damaged file was set aside.
  bool set_aside() const { return set_aside_; }

 private:
  void TakeOver(std::string text, const std::filesystem::path& path, const std::string& mark);
  void Write(const std::string& text);

  std::optional<OpenFile> file_, mark_;
  std::map<std::string, int64_t, std::less<>> last_;  ///< step of each key
  uint64_t size_ = 0;
  uint32_t checksum_ = 0;
  bool set_aside_ = false;
};

/// In a file of an earlier version the last row of each (step, key) counts. A last row without its end of line is being
/// written, or was cut off, and is left out.
/// @throws DataError when the file cannot be read, is not what checkpoint.curves says, or a row is not
/// `step,key,value`.
Curves ReadCurves(const std::filesystem::path& path);

}  // namespace oted
