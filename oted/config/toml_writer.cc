#include "oted/config/toml_writer.h"

#include <nlohmann/json.hpp>

namespace oted {

using nlohmann::json;

void WriteTomlValue(std::ostream& out, const nlohmann::json& value) {
  if (value.is_object()) {
    out << "{ ";
    for (auto it = value.begin(); it != value.end(); ++it) {
      if (it != value.begin()) out << ", ";
      out << it.key() << " = ";
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
