#pragma once
/// The verdict in sentences: what was asked, what was found, what stays unknown.

#include <nlohmann/json_fwd.hpp>

namespace oted {

/// {"verdict", "headline", "asked", "found": [...], "unknown": [...]}, plain text.
/// @param report  what GatherReport returned
nlohmann::json Summarise(const nlohmann::json& report);

}  // namespace oted
