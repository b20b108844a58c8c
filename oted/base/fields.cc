#include "oted/base/fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "oted/base/error.h"

namespace oted {
namespace {

using nlohmann::json;

template <class T>
struct IsVector : std::false_type {};
template <class T>
struct IsVector<std::vector<T>> : std::true_type {};

template <class T>
struct IsTable : std::false_type {};
template <class T>
struct IsTable<std::map<std::string, T>> : std::true_type {};

/// Reads one scalar of type T; false when the JSON value is of another kind.
template <class T>
bool ReadScalar(const json& value, T& out) {
  if constexpr (std::is_same_v<T, bool>) {
    if (!value.is_boolean()) return false;
  } else if constexpr (std::is_same_v<T, std::string>) {
    if (!value.is_string()) return false;
  } else if constexpr (std::is_integral_v<T>) {
    // 1e5 is a number that is whole: accept it, as people write step counts like that.
    if (!value.is_number()) return false;
    const double number = value.get<double>();
    if (number != std::floor(number) || std::abs(number) > 9e15) return false;
    if (number > static_cast<double>(std::numeric_limits<T>::max())) return false;
    if (number < static_cast<double>(std::numeric_limits<T>::lowest())) return false;
    out = value.is_number_integer() ? value.get<T>() : static_cast<T>(number);
    return true;
  } else {
    if (!value.is_number()) return false;
  }
  out = value.get<T>();
  return true;
}

template <class T>
bool InRange(const Range& range, const T& value) {
  if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    return range.Contains(static_cast<double>(value));
  } else {
    return true;
  }
}

/// What people type for a number and JSON does not know: 200_000 as TOML has it, .5, 5. and +1.
std::string AsJsonNumber(std::string_view text) {
  const auto is_digit = [&](size_t i) { return i < text.size() && '0' <= text[i] && text[i] <= '9'; };
  std::string number;
  for (size_t i = 0; i < text.size(); ++i) {
    if (i == 0 && text[i] == '+') continue;
    if (text[i] == '_' && i > 0 && is_digit(i - 1) && is_digit(i + 1)) continue;
    if (text[i] != '.') {
      number += text[i];
      continue;
    }
    const bool before = i > 0 && is_digit(i - 1), after = is_digit(i + 1);
    number += before ? "." : "0.";
    if (before && !after) number += '0';
  }
  return number;
}

/// A value as typed: JSON, a number, or else text.
json AsTyped(std::string_view text) {
  if (json value = json::parse(text, nullptr, false); !value.is_discarded()) return value;
  const json number = json::parse(AsJsonNumber(text), nullptr, false);
  return number.is_number() ? number : json(text);
}

std::vector<std::string> Split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  while (true) {
    const size_t end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

/// As in the file: JSON knows no nan and no inf.
std::string Shown(const json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) return fmt::format("{}", value.get<double>());
  if (!value.is_array()) return value.dump();
  std::vector<std::string> parts;
  for (const json& part : value) parts.push_back(Shown(part));
  return fmt::format("[{}]", fmt::join(parts, ","));
}

}  // namespace

bool Range::Contains(double value) const {
  if (std::isnan(value)) return false;
  return (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
}

std::string Range::ToString() const {
  if (std::isinf(low) && std::isinf(high)) return "";
  return fmt::format("{}{}, {}{}", low_open ? '(' : '[', low, high, high_open ? ')' : ']');
}

std::string Field::TypeName() const {
  static constexpr const char* kNames[] = {"true|false",      "int",           "int",
                                           "number",          "text",          "list of ints",
                                           "list of numbers", "list of texts", "table of numbers"};
  if (!choices.empty()) return fmt::format("{}", fmt::join(choices, "|"));
  return kNames[target.index()];
}

json Field::ToJson() const {
  if (const auto* named = std::get_if<NamedTarget>(&target)) return named->get();
  return std::visit(
      [](const auto& value) {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(value)>>) return json(*value);
        return json();
      },
      target);
}

void Field::FromJson(const json& value, std::string_view where) const {
  const auto fail = [&](const std::string& wanted) {
    throw UsageError(fmt::format("{}: {} is {}, wanted {}", where, name, Shown(value), wanted));
  };
  const auto check_choice = [&](const std::string& chosen) {
    if (choices.empty() || std::find(choices.begin(), choices.end(), chosen) != choices.end()) return;
    fail("one of " + TypeName() + DidYouMean(chosen, choices));
  };
  if (const auto* named = std::get_if<NamedTarget>(&target)) {
    if (!value.is_string()) fail("one of " + TypeName());
    check_choice(value.get<std::string>());
    named->set(value.get<std::string>());
    return;
  }
  constexpr int kMost = std::numeric_limits<int>::max();
  if (std::holds_alternative<int*>(target) && value.is_number() && value.get<double>() > kMost) {
    fail(fmt::format("at most {}", kMost));
  }
  const std::string wanted = range.ToString().empty() ? TypeName() : TypeName() + " in " + range.ToString();
  std::visit(
      [&](const auto& out) {
        using Bound = std::decay_t<decltype(out)>;
        if constexpr (std::is_pointer_v<Bound>) {
          using T = std::remove_pointer_t<Bound>;
          T parsed{};
          if constexpr (IsVector<T>::value) {
            if (!value.is_array()) fail(wanted);
            for (const json& element : value) {
              typename T::value_type scalar{};
              if (!ReadScalar(element, scalar) || !InRange(range, scalar)) fail(wanted);
              parsed.push_back(scalar);
            }
          } else if constexpr (IsTable<T>::value) {
            if (!value.is_object()) fail(wanted);
            for (const auto& [key, element] : value.items()) {
              if (!ReadScalar(element, parsed[key]) || !InRange(range, parsed[key])) fail(wanted);
            }
          } else {
            if (!ReadScalar(value, parsed) || !InRange(range, parsed)) fail(wanted);
          }
          if constexpr (std::is_same_v<T, std::string>) {
            check_choice(parsed);
          }
          *out = std::move(parsed);
        }
      },
      target);
}

void Field::FromText(std::string_view text, std::string_view where) const {
  const bool is_text = std::holds_alternative<std::string*>(target) || std::holds_alternative<NamedTarget>(target);
  const bool is_text_list = std::holds_alternative<std::vector<std::string>*>(target);
  const bool is_list = is_text_list || std::holds_alternative<std::vector<int>*>(target) ||
                       std::holds_alternative<std::vector<double>*>(target);
  json value;
  if (is_text) {
    value = std::string(text);
  } else if (is_list && !text.starts_with('[')) {
    value = json::array();
    if (!text.empty()) {
      for (const std::string& part : Split(text, ',')) value.push_back(is_text_list ? json(part) : AsTyped(part));
    }
  } else {
    value = AsTyped(text);
  }
  FromJson(value, where);
}

void FieldList::Add(std::string name, Field::Target target, std::string help, Range range) {
  fields_.push_back({std::move(name), target, std::move(help), range, {}});
}

void FieldList::AddChoice(std::string name, std::string* target, std::string help, std::vector<std::string> choices) {
  fields_.push_back({std::move(name), target, std::move(help), {}, std::move(choices)});
}

const Field& FieldList::Find(std::string_view name, std::string_view where) const {
  std::vector<std::string> names;
  for (const Field& field : fields_) {
    if (field.name == name) return field;
    names.push_back(field.name);
  }
  if (IsStructure(name)) {
    throw UsageError(fmt::format("{}: {}.{} is no single value; write it in a task file", where, section_, name));
  }
  names.insert(names.end(), structures_.begin(), structures_.end());
  throw UsageError(fmt::format("{}: {}.{} is not a setting{}; the settings of [{}] are: {}", where, section_, name,
                               DidYouMean(name, names), section_, fmt::join(names, ", ")));
}

json FieldList::ToJson() const {
  json object = json::object();
  for (const Field& field : fields_) object[field.name] = field.ToJson();
  return object;
}

void FieldList::FromJson(const json& object, std::string_view where) const {
  if (!object.is_object()) throw UsageError(fmt::format("{}: [{}] is not a table of settings", where, section_));
  for (const auto& [key, value] : object.items()) Find(key, where).FromJson(value, where);
}

std::string NearestName(std::string_view name, const std::vector<std::string>& candidates) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  const auto distance = [&](std::string_view other) {
    std::vector<size_t> row(other.size() + 1);
    for (size_t j = 0; j <= other.size(); ++j) row[j] = j;
    for (size_t i = 1; i <= name.size(); ++i) {
      size_t diagonal = row[0];
      row[0] = i;
      for (size_t j = 1; j <= other.size(); ++j) {
        const size_t above = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (lower(name[i - 1]) != lower(other[j - 1]))});
        diagonal = above;
      }
    }
    return row.back();
  };
  std::string best;
  size_t best_distance = std::max<size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const size_t d = distance(candidate);
    // Of two short names every letter may differ.
    if (d < best_distance && d < std::min(name.size(), candidate.size())) {
      best_distance = d;
      best = candidate;
    }
  }
  return best;
}

std::string DidYouMean(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string nearest = NearestName(name, candidates);
  return nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest);
}

}  // namespace oted
