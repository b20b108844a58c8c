#pragma once
/// Stage 3: which setting of the design is used.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section SelectionSection(const nlohmann::json& report);

}  // namespace oted
