#pragma once
/// What came out: the parameters, what they predict, and the policies.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section ParametersSection(const nlohmann::json& report);
/// How the design predicts logs that it did not see.
Section ValidationSection(const nlohmann::json& report);
Section PoliciesSection(const nlohmann::json& report);

}  // namespace oted
