#include "oted/data/log_columns.h"

#include <fmt/format.h>

#include <limits>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/csv.h"
#include "oted/data/field_text.h"
#include "oted/data/gzip.h"

namespace oted {
namespace {

/// Takes the fields as numbers where all of them are; an empty one is NaN.
void Convert(LogColumn& column, const std::vector<int64_t>& lines) {
  std::vector<double> values;
  for (size_t i = 0; i < column.text.size(); ++i) {
    const std::optional<double> number = ParseNumber(column.text[i]);
    if (number.has_value() || Trimmed(column.text[i]).empty()) {
      values.push_back(number.value_or(std::numeric_limits<double>::quiet_NaN()));
    } else if (column.text_line == 0) {
      column.text_line = lines[i];
      column.text_field = column.text[i];
    }
  }
  column.is_damaged = column.text_line > 0 && values.size() > column.text.size() / 2;
  if (column.text_line > 0) return;
  column.values = std::move(values);
  column.text.clear();
}

}  // namespace

std::vector<LogColumn> ReadLogColumns(const std::string& path) {
  CheckIsFile(path);
  std::string text = ReadFile(path);
  if (IsGzip(text)) text = Gunzip(text, path);
  CsvParser parser(text, path);
  std::vector<std::string> fields;
  if (!parser.Next(fields)) throw DataError(fmt::format("'{}' is empty, wanted a header and rows", path));
  CheckSeparator(fields, path);
  std::vector<LogColumn> columns(fields.size());
  for (size_t i = 0; i < fields.size(); ++i) {
    columns[i].name = std::string(Trimmed(fields[i]));
    if (!IsUtf8(columns[i].name)) {
      throw DataError(fmt::format("'{}' line 1: a column's name is not UTF-8; save it as UTF-8", path));
    }
  }
  std::vector<int64_t> lines;
  while (parser.Next(fields)) {
    lines.push_back(parser.line());
    if (fields.size() != columns.size()) {
      throw DataError(fmt::format("'{}' line {}: {} fields, but the header has {}; repair or remove the row", path,
                                  parser.line(), fields.size(), columns.size()));
    }
    for (size_t i = 0; i < fields.size(); ++i) columns[i].text.push_back(std::move(fields[i]));
  }
  if (columns[0].text.size() < 2) {
    throw DataError(fmt::format("'{}' has {} rows, wanted one per control step", path, columns[0].text.size()));
  }
  for (LogColumn& column : columns) Convert(column, lines);
  return columns;
}

}  // namespace oted
