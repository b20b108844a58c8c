#pragma once
/// The verdict in sentences: what was asked, what was found, what speaks for believing it, what stays unknown.

#include <nlohmann/json_fwd.hpp>

namespace oted {

/// {"verdict", "headline", "asked", "found": [...], "trust": [...], "unknown": [...]}, plain text.
/// @param report  what GatherReport returned
nlohmann::json Summarise(const nlohmann::json& report);

}  // namespace oted
