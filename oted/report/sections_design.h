#pragma once
/// Stage 2: the distribution over the parameters and its discriminator.
/// Each takes the content of report.json; its `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section DesignSection(const nlohmann::json& report);
Section DiscriminatorSection(const nlohmann::json& report);

}  // namespace oted
