#include "oted/data/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"

namespace oted {

CsvParser::CsvParser(std::string_view text, std::string file) : text_(text), file_(std::move(file)) {
  if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  if (text_.starts_with("\xFF\xFE") || text_.starts_with("\xFE\xFF")) {
    throw DataError(fmt::format("'{}' is in UTF-16; save it as UTF-8", file_));
  }
  if (text_.find('\0') != std::string_view::npos) {
    throw DataError(fmt::format("'{}' has binary content, wanted comma-separated text; check the path", file_));
  }
}

bool CsvParser::Next(std::vector<std::string>& fields) {
  fields.clear();
  while (at_ < text_.size() && (text_[at_] == '\n' || text_[at_] == '\r')) SkipLineEnd();
  if (at_ == text_.size()) return false;
  record_line_ = line_;
  while (true) {
    if (at_ < text_.size() && text_[at_] == '"') {
      fields.push_back(QuotedField());
    } else {
      const size_t end = std::min(text_.find_first_of(",\"\r\n", at_), text_.size());
      if (end < text_.size() && text_[end] == '"') {
        throw DataError(fmt::format("'{}' line {}: a quote in the middle of field {}; put the whole field in quotes",
                                    file_, line_, fields.size() + 1));
      }
      fields.emplace_back(text_.substr(at_, end - at_));
      at_ = end;
    }
    if (at_ == text_.size()) return true;
    if (text_[at_] != ',') {
      SkipLineEnd();
      return true;
    }
    ++at_;
  }
}

std::string CsvParser::QuotedField() {
  const int64_t begin = line_;
  std::string field;
  for (++at_; at_ < text_.size(); ++at_) {
    if (text_[at_] == '\n') ++line_;
    if (text_[at_] != '"') {
      field += text_[at_];
    } else if (at_ + 1 < text_.size() && text_[at_ + 1] == '"') {
      field += '"';
      ++at_;
    } else {
      ++at_;
      if (at_ < text_.size() && text_[at_] != ',' && text_[at_] != '\n' && text_[at_] != '\r') {
        throw DataError(
            fmt::format("'{}' line {}: text behind a closing quote; double the quotes inside a field", file_, line_));
      }
      return field;
    }
  }
  throw DataError(fmt::format("'{}' line {}: a quote is never closed; close it", file_, begin));
}

void CsvParser::SkipLineEnd() {
  if (text_[at_] == '\r' && at_ + 1 < text_.size() && text_[at_ + 1] == '\n') ++at_;
  ++at_;
  ++line_;
}

bool IsUtf8(const std::string& text) {
  try {
    static_cast<void>(nlohmann::json(text).dump());
    return true;
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

void CheckSeparator(const std::vector<std::string>& header, const std::string& file) {
  if (header.size() != 1 || header[0].find_first_of(";\t") == std::string::npos) return;
  throw DataError(
      fmt::format("'{}' line 1: columns are separated by {}, wanted commas; save it with commas, and with "
                  "points in numbers",
                  file, header[0].find(';') != std::string::npos ? "semicolons" : "tabs"));
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace oted
