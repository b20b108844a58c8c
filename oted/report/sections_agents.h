#pragma once
/// Stages 4 and 5: the agents, and which of them is used.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section AgentsSection(const nlohmann::json& report);
Section PolicySelectionSection(const nlohmann::json& report);

}  // namespace oted
