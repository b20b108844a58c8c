#include "oted/report/curves.h"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

constexpr std::string_view kHeader = "step,key,value\n";

struct Row {
  int64_t step = 0;
  std::string key;
  double value = 0;
};

template <class T>
bool Parse(std::string_view text, T* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

// RFC 4180: a field with a comma or a quote stands in quotes, and its quotes are doubled.
std::string Quoted(std::string_view key) {
  if (key.find_first_of(",\"") == std::string_view::npos) return std::string(key);
  std::string quoted = "\"";
  for (const char c : key) quoted.append(c == '"' ? 2 : 1, c);
  return quoted + '"';
}

std::string Unquoted(std::string_view field) {
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return std::string(field);
  std::string key;
  for (size_t i = 1; i + 1 < field.size(); ++i) {
    key.push_back(field[i]);
    if (field[i] == '"') ++i;
  }
  return key;
}

// The key stands between the first comma and the last: the two numbers hold none.
std::optional<Row> ParseRow(std::string_view line) {
  const size_t first = line.find(',');
  const size_t last = line.rfind(',');
  if (first == std::string_view::npos || first == last) return std::nullopt;
  Row row{.key = Unquoted(line.substr(first + 1, last - first - 1))};
  if (!Parse(line.substr(0, first), &row.step) || !Parse(line.substr(last + 1), &row.value)) return std::nullopt;
  return row;
}

void CheckHeader(const std::filesystem::path& path, std::string_view text) {
  if (text.starts_with(kHeader)) return;
  throw DataError(
      fmt::format("'{}' is no curves file: its first line is not 'step,key,value'; move it away, or name "
                  "another run directory",
                  path.string()));
}

}  // namespace

const Curve& Curves::At(const std::string& key) const {
  static const Curve kNone;
  const auto found = by_key.find(key);
  return found == by_key.end() ? kNone : found->second;
}

CurvesWriter::CurvesWriter(const std::filesystem::path& path) : path_(path) {
  std::error_code failed;
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), failed);
  bool started = false;
  if (std::filesystem::exists(path, failed)) {
    const std::string text = ReadFile(path);
    const size_t complete = text.rfind('\n') + 1;  // 0 when there is no complete line
    started = complete > 0;
    if (started) CheckHeader(path, text);
    if (complete < text.size()) std::filesystem::resize_file(path, complete, failed);
  }
  file_.open(path, std::ios::binary | std::ios::app);
  if (!file_) {
    throw DataError(fmt::format("cannot write '{}': {}; choose a run directory that can be written", path.string(),
                                std::strerror(errno)));
  }
  if (!started) file_ << kHeader << std::flush;
}

void CurvesWriter::Append(int64_t step, std::string_view key, double value) {
  OTED_CHECK(!key.empty() && key.find_first_of("\r\n") == std::string_view::npos);
  file_ << fmt::format("{},{},{}\n", step, Quoted(key), value) << std::flush;
  if (!file_) throw DataError(fmt::format("cannot write '{}': free some disk space and run again", path_.string()));
}

Curves ReadCurves(const std::filesystem::path& path) {
  const std::string text = ReadFile(path);
  CheckHeader(path, text);
  std::map<std::string, std::map<int64_t, double>> values;
  int line_number = 1;
  for (size_t begin = kHeader.size(), end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    ++line_number;
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    std::optional<Row> row = ParseRow(line);
    if (!row) {
      throw DataError(fmt::format("'{}' line {}: got '{}', wanted step,key,value; remove that line, or the file",
                                  path.string(), line_number, line.substr(0, 60)));
    }
    values[std::move(row->key)][row->step] = row->value;
  }
  Curves curves;
  for (const auto& [key, by_step] : values) curves.by_key[key].assign(by_step.begin(), by_step.end());
  return curves;
}

}  // namespace oted
