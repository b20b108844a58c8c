#pragma once
/// A CSV as it is, before anyone has said what its columns are.

#include <cstdint>
#include <string>
#include <vector>

namespace oted {

struct LogColumn {
  std::string name;
  std::vector<double> values;     ///< one per row, NaN where the field is empty; none where a field is no number
  std::vector<std::string> text;  ///< the fields, where `values` is empty
  int64_t text_line = 0;          ///< of the first field that is no number; 0 where there is none
  std::string text_field;         ///< that field
  /// A column of numbers with a few fields that are none, and not one of words.
  bool is_damaged = false;
  bool is_numeric() const { return !values.empty(); }
};

/// Every column of a .csv or .csv.gz. @throws DataError naming file and line; where there are no rows
std::vector<LogColumn> ReadLogColumns(const std::string& path);

}  // namespace oted
