#pragma once
/// Reads a JSON record of a run. What is missing or of another type is an error that names the file and the field.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "oted/base/error.h"

namespace oted {

class RecordReader {
 public:
  /// @param where  the file, for errors
  /// @throws DataError unless `record` is an object
  RecordReader(const nlohmann::json& record, std::string where);
  /// The same for a whole file. @throws DataError unless its schema is that one
  RecordReader(const nlohmann::json& record, std::string_view schema, std::string where);

  bool Has(const char* field) const { return record_.contains(field) && !record_.at(field).is_null(); }

  /// What `read` makes of a field; it may throw any nlohmann::json::exception, or a UsageError.
  template <class F>
  auto Read(const char* field, const F& read) const {
    try {
      return read(record_.at(field));
    } catch (const nlohmann::json::exception& e) {
      Fail(field, e.what());
    } catch (const UsageError& e) {  // of a setting's value: here the record is damaged
      Fail(field, e.what());
    }
  }
  /// @throws DataError where it is missing or of another type
  template <class T>
  T Get(const char* field) const {
    return Read(field, [](const nlohmann::json& value) { return value.get<T>(); });
  }
  /// Null is NaN.
  double Number(const char* field) const;
  std::vector<double> Numbers(const char* field) const;
  /// Null or absent: none.
  template <class T>
  std::optional<T> Find(const char* field) const {
    return Has(field) ? std::optional<T>(Get<T>(field)) : std::nullopt;
  }
  /// An object in this one.
  RecordReader At(const char* field) const;
  /// A list of objects; an absent one is empty.
  std::vector<RecordReader> List(const char* field) const;
  /// The enum value that a field names.
  template <class E, class Names>
  E GetNamed(const char* field, const Names& names) const {
    const std::string name = Get<std::string>(field);
    for (const auto& [value, known] : names) {
      if (known == name) return value;
    }
    Fail(field, "'" + name + "' is unknown");
  }
  /// @throws DataError, always
  [[noreturn]] void Fail(const std::string& field, const std::string& why) const;

 private:
  static double NumberOf(const nlohmann::json& value);
  const nlohmann::json& record_;
  std::string where_;
};

}  // namespace oted
