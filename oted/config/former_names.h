#pragma once
/// Settings that had other names.

#include <string>
#include <string_view>

namespace oted {

/// @throws UsageError that names the present setting, for a former name of one
void RefuseFormerName(const std::string& section, std::string_view key, std::string_view where);

}  // namespace oted
