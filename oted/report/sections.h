#pragma once
/// The parts of the page, in the paper's order. Each takes the content of report.json and shows nothing else; its
/// `html` is empty when the run has nothing for it.

#include <nlohmann/json_fwd.hpp>

#include "oted/report/html_text.h"

namespace oted {

Section ParametersSection(const nlohmann::json& report);
Section ReplaySection(const nlohmann::json& report);
Section PoliciesSection(const nlohmann::json& report);
Section DataSection(const nlohmann::json& report);
Section CloneSection(const nlohmann::json& report);
Section DesignSection(const nlohmann::json& report);
Section DiscriminatorSection(const nlohmann::json& report);
Section SelectionSection(const nlohmann::json& report);
Section AgentsSection(const nlohmann::json& report);
Section PolicySelectionSection(const nlohmann::json& report);
Section WarningsSection(const nlohmann::json& report);
Section RunSection(const nlohmann::json& report);

}  // namespace oted
