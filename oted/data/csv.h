#pragma once
/// Comma-separated values (RFC 4180): records of fields, with the line each stands on. Strict, independent of the
/// locale. Written here because Debian's header-only parser fixes the columns at compile time and its C parser knows no
/// lines.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// Walks through the records of a text. Fields may stand in double quotes ("" is a quote); lines end in LF, CRLF or CR;
/// a byte order mark is skipped, and so are empty lines.
class CsvParser {
 public:
  /// `text` must outlive the parser; `file` names it in errors. @throws DataError on UTF-16 and binary files
  CsvParser(std::string_view text, std::string file);
  /// The next record; false at the end. @throws DataError naming the line on a stray or unclosed quote
  bool Next(std::vector<std::string>& fields);
  /// The line on which the last record begins, from 1.
  int64_t line() const { return record_line_; }

 private:
  std::string QuotedField();
  void SkipLineEnd();
  std::string_view text_;
  std::string file_;
  size_t at_ = 0;
  int64_t line_ = 1;
  int64_t record_line_ = 0;
};

/// Whether a text is UTF-8, as JSON and TOML want it.
bool IsUtf8(const std::string& text);

/// @throws DataError where the first record is one field with semicolons or tabs in it
void CheckSeparator(const std::vector<std::string>& header, const std::string& file);

/// A field as it must stand in a file: in quotes where it has a comma, a quote or a line end.
std::string CsvField(const std::string& text);

}  // namespace oted
