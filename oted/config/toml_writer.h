#pragma once
/// JSON values as TOML.

#include <nlohmann/json_fwd.hpp>
#include <ostream>

namespace oted {

/// A scalar, an array of scalars, or an object of them as an inline table.
void WriteTomlValue(std::ostream& out, const nlohmann::json& value);

}  // namespace oted
