#pragma once
/// Stage 1: the logs and the clone.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section DataSection(const nlohmann::json& report);
Section CloneSection(const nlohmann::json& report);

}  // namespace oted
