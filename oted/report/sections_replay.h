#pragma once
/// What people look at first: the logs beside what the nominal and the designed simulator make of the same actions.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section ReplaySection(const nlohmann::json& report);

}  // namespace oted
