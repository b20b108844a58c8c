#pragma once
/// What was run, and what went wrong.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section WarningsSection(const nlohmann::json& report);
Section RunSection(const nlohmann::json& report);

}  // namespace oted
