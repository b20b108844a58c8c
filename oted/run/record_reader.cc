#include "oted/run/record_reader.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "oted/base/error.h"

namespace oted {

using nlohmann::json;

RecordReader::RecordReader(const json& record, std::string where) : record_(record), where_(std::move(where)) {
  if (!record.is_object())
    throw DataError(fmt::format("'{}' holds no JSON object; remove it to make it again", where_));
}

RecordReader::RecordReader(const json& record, std::string_view schema, std::string where)
    : RecordReader(record, std::move(where)) {
  if (const auto found = Get<std::string>("schema"); found != schema) {
    throw DataError(fmt::format("'{}': schema is '{}', wanted '{}'; it was made by another version of oted", where_,
                                found, schema));
  }
}

RecordReader RecordReader::At(const char* field) const {
  if (!record_.contains(field)) Fail(field, "it is missing");
  return {record_.at(field), fmt::format("{}: {}", where_, field)};
}

std::vector<RecordReader> RecordReader::List(const char* field) const {
  std::vector<RecordReader> list;
  if (!Has(field)) return list;
  if (!record_.at(field).is_array()) Fail(field, "it is no list");
  for (const json& entry : record_.at(field)) {
    list.emplace_back(entry, fmt::format("{}: {}[{}]", where_, field, list.size()));
  }
  return list;
}

double RecordReader::NumberOf(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

double RecordReader::Number(const char* field) const { return Read(field, NumberOf); }

std::vector<double> RecordReader::Numbers(const char* field) const {
  return Read(field, [](const json& list) {
    std::vector<double> numbers;
    for (const json& value : list.get_ref<const json::array_t&>()) numbers.push_back(NumberOf(value));
    return numbers;
  });
}

void RecordReader::Fail(const std::string& field, const std::string& why) const {
  throw DataError(
      fmt::format("'{}': field '{}' cannot be read ({}); remove the file and run 'oted design' or 'oted run' again",
                  where_, field, why));
}

}  // namespace oted
