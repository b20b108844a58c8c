#include "oted/config/toml_writer.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

namespace oted {

using nlohmann::json;

namespace {

bool IsBareKey(const std::string& key) {
  const auto is_bare = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
  return !key.empty() && std::ranges::all_of(key, is_bare);
}

}  // namespace

void WriteTomlValue(std::ostream& out, const nlohmann::json& value) {
  if (value.is_object()) {
    out << "{ ";
    for (auto it = value.begin(); it != value.end(); ++it) {
      if (it != value.begin()) out << ", ";
      out << (IsBareKey(it.key()) ? it.key() : nlohmann::json(it.key()).dump()) << " = ";
      WriteTomlValue(out, it.value());
    }
    out << " }";
  } else if (value.is_array() && !value.empty() && value.front().is_object()) {
    out << "[";
    for (auto it = value.begin(); it != value.end(); ++it) {
      out << (it == value.begin() ? "\n  " : ",\n  ");
      WriteTomlValue(out, *it);
    }
    out << "\n]";
  } else {
    // JSON's scalars and arrays of scalars are TOML's.
    out << value.dump();
  }
}

}  // namespace oted
