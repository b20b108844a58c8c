#include "oted/data/log_columns.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/csv.h"
#include "oted/data/gzip.h"

namespace oted {
namespace {

std::string_view WithoutBlanks(std::string_view text) {
  const size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

/// NaN for an empty field. @return false where it is no number
bool ToNumber(std::string_view text, double& number) {
  text = WithoutBlanks(text);
  number = std::numeric_limits<double>::quiet_NaN();
  if (text.empty()) return true;
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && rest == text.data() + text.size();
}

/// Takes the fields as numbers where all of them are.
void Convert(LogColumn& column, const std::vector<int64_t>& lines) {
  std::vector<double> values;
  for (size_t i = 0; i < column.text.size(); ++i) {
    double number = 0;
    if (ToNumber(column.text[i], number)) {
      values.push_back(number);
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
    columns[i].name = std::string(WithoutBlanks(fields[i]));
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
