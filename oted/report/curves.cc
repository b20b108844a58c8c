#include "oted/report/curves.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <charconv>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/whole_mark.h"

namespace oted {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kHeader = "step,key,value\n";
constexpr const char* kMarkFile = "checkpoint.curves";

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

void CheckHeader(const fs::path& path, std::string_view text) {
  if (text.starts_with(kHeader)) return;
  throw DataError(
      fmt::format("'{}' is no curves file: its first line is not 'step,key,value'; move it away, or name "
                  "another run directory",
                  path.string()));
}

std::vector<Row> Rows(const std::string& text, const fs::path& path) {
  std::vector<Row> rows;
  int line_number = 1;
  for (size_t begin = kHeader.size(), end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    ++line_number;
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    std::optional<Row> row = ParseRow(line);
    if (!row) {
      throw DataError(fmt::format("'{}' line {}: got '{}', wanted step,key,value; remove that line, or the file",
                                  path.string(), line_number, line.substr(0, 60)));
    }
    rows.push_back(std::move(*row));
  }
  return rows;
}

/// Whether the file begins with what the mark is of.
bool IsWhole(std::string_view text, std::string_view mark_text) {
  const auto mark = WholeMark::FromText(mark_text);
  return mark && mark->size >= kHeader.size() && mark->Fits(text);
}

}  // namespace

const Curve& Curves::At(const std::string& key) const {
  static const Curve kNone;
  const auto found = by_key.find(key);
  return found == by_key.end() ? kNone : found->second;
}

CurvesWriter::CurvesWriter(const fs::path& path, std::string_view least) {
  if (path.has_parent_path()) MakeFolders(path.parent_path());
  const fs::path mark_file = path.parent_path() / kMarkFile;
  std::string text, mark;
  if (fs::exists(path)) text = ReadFile(path);
  if (fs::exists(mark_file)) mark = ReadFile(mark_file);
  const size_t complete = text.rfind('\n') + 1;  // 0 when there is no complete line
  if (complete > 0 && mark.empty()) CheckHeader(path, text);
  if ((!mark.empty() && !IsWhole(text, mark)) || (!least.empty() && !IsWhole(text, least))) {
    if (fs::exists(path)) fs::rename(path, path.string() + ".damaged");
    set_aside_ = true;
    text.clear();
    mark.clear();
  } else if (!least.empty() && (mark.empty() || WholeMark::FromText(mark)->size < WholeMark::FromText(least)->size)) {
    mark = least;
  }
  file_.emplace(path, O_WRONLY | O_CREAT);
  mark_.emplace(mark_file, O_WRONLY | O_CREAT);
  TakeOver(std::move(text), path, mark);
}

/// Goes on behind what is whole of `text`.
void CurvesWriter::TakeOver(std::string text, const fs::path& path, const std::string& mark) {
  text.resize(mark.empty() ? text.rfind('\n') + 1 : WholeMark::FromText(mark)->size);
  file_->Truncate(text.size());
  if (text.empty()) return Write(std::string(kHeader));
  for (Row& row : Rows(text, path)) last_[std::move(row.key)] = row.step;
  size_ = text.size();
  checksum_ = Checksum(0, text);
}

std::string CurvesWriter::MarkOfAll() const { return WholeMark{size_, checksum_}.ToText(); }

void CurvesWriter::Write(const std::string& text) {
  file_->WriteAt(size_, text);
  size_ += text.size();
  checksum_ = Checksum(checksum_, text);
  mark_->WriteAt(0, MarkOfAll());
}

void CurvesWriter::Append(int64_t step, std::string_view key, double value) {
  OTED_CHECK(!key.empty() && key.find_first_of("\r\n") == std::string_view::npos);
  const auto [last, is_new] = last_.try_emplace(std::string(key), step);
  if (!is_new && step <= last->second) return;
  last->second = step;
  Write(fmt::format("{},{},{}\n", step, Quoted(key), value));
}

Curves ReadCurves(const fs::path& path) {
  const fs::path mark_file = path.parent_path() / kMarkFile;
  // First: a row that is written meanwhile then lies behind the mark.
  const std::string mark = fs::exists(mark_file) ? ReadFile(mark_file) : "";
  const std::string text = ReadFile(path);
  if (!mark.empty() && !IsWhole(text, mark)) {
    throw DataError(fmt::format("'{}' is damaged: it is not what '{}' says; remove both, or go on with the run",
                                path.string(), mark_file.string()));
  }
  CheckHeader(path, text);
  std::map<std::string, std::map<int64_t, double>> values;
  for (Row& row : Rows(text, path)) values[std::move(row.key)][row.step] = row.value;
  Curves curves;
  for (const auto& [key, by_step] : values) curves.by_key[key].assign(by_step.begin(), by_step.end());
  return curves;
}

}  // namespace oted
