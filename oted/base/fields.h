#pragma once
/// One list of fields per config struct feeds TOML, command-line flags, Python and the run record.
///
///   struct CloneConfig {
///     int batch_size = 256;
///     FieldList Fields() {
///       FieldList fields("clone");
///       fields.Add("batch_size", &batch_size, "transitions per gradient step", AtLeast(1));
///       return fields;
///     }
///   };

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace oted {

/// Closed or half-open range of a numeric setting.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;
  bool high_open = false;
  bool Contains(double value) const;
  /// For example "[1, inf)" or "(0, 1]"; empty when unbounded.
  std::string ToString() const;
};
inline Range AtLeast(double low) { return {.low = low, .high_open = true}; }
inline Range Above(double low) { return {.low = low, .low_open = true, .high_open = true}; }
inline Range Between(double low, double high) { return {.low = low, .high = high}; }
inline Range AboveUpTo(double low, double high) { return {.low = low, .high = high, .low_open = true}; }

/// The values of an enum with their names, in the order in which they are documented.
template <class E>
using NamedValues = std::vector<std::pair<E, std::string>>;

/// @throws std::out_of_range when `value` has no name
template <class E>
const std::string& NameOf(const NamedValues<E>& names, const E& value) {
  size_t i = 0;
  while (i < names.size() && !(names[i].first == value)) ++i;
  return names.at(i).second;
}

/// Reads and writes an enum by the names of its values.
struct NamedTarget {
  std::function<std::string()> get;
  std::function<void(const std::string& name)> set;
};

/// One setting, bound to the struct it was listed from.
struct Field {
  using Target = std::variant<bool*, int*, int64_t*, double*, std::string*, std::vector<int>*, std::vector<double>*,
                              std::vector<std::string>*, std::map<std::string, double>*, NamedTarget>;
  std::string name;
  Target target;
  std::string help;  ///< what it is, with its unit
  Range range;       ///< of the value, or of each element
  std::vector<std::string> choices;

  /// The value as JSON.
  nlohmann::json ToJson() const;
  /// Takes the value from JSON. @throws UsageError naming `where`, the field, what it got and what it takes.
  void FromJson(const nlohmann::json& value, std::string_view where) const;
  /// Takes the value from text as typed on a command line ("3", "0.1", "200_000", "true", "1,2,3").
  void FromText(std::string_view text, std::string_view where) const;
  /// "int", "number", "text", "true|false", "list of numbers", "list of texts", "table of numbers".
  std::string TypeName() const;
};

/// The settings of one section, in the order in which they are documented.
class FieldList {
 public:
  explicit FieldList(std::string section) : section_(std::move(section)) {}
  void Add(std::string name, Field::Target target, std::string help, Range range = {});
  void AddChoice(std::string name, std::string* target, std::string help, std::vector<std::string> choices);
  template <class E>
  void AddChoice(std::string name, E* target, std::string help, const NamedValues<E>& names) {
    std::vector<std::string> choices;
    for (const auto& [unused, choice] : names) choices.push_back(choice);
    const auto set = [target, names](const std::string& wanted) {
      for (const auto& [value, choice] : names) {
        if (choice == wanted) *target = value;
      }
    };
    fields_.push_back({std::move(name),
                       NamedTarget{[target, names] { return NameOf(names, *target); }, set},
                       std::move(help),
                       {},
                       std::move(choices)});
  }

  /// A setting of the section that is no field, as its value is a structure: others read it.
  void AddStructure(std::string name) { structures_.push_back(std::move(name)); }

  const std::string& section() const { return section_; }
  const std::vector<Field>& fields() const { return fields_; }
  bool IsStructure(std::string_view name) const { return std::ranges::find(structures_, name) != structures_.end(); }
  /// @throws UsageError with the nearest name when there is no such field.
  const Field& Find(std::string_view name, std::string_view where) const;
  nlohmann::json ToJson() const;
  /// Reads an object; a key that is no field is an error.
  void FromJson(const nlohmann::json& object, std::string_view where) const;

 private:
  std::string section_;
  std::vector<Field> fields_;
  std::vector<std::string> structures_;
};

/// The candidate nearest to `name` in edit distance, whatever the case of letters, or "" when none is near.
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);
/// " (did you mean 'x'?)" or "".
std::string DidYouMean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace oted
