#pragma once
/// How far a plan is, on the terminal and as a page.

#include <filesystem>
#include <string>

#include "oted/plan/plan_state.h"

namespace oted::cli {

/// The terminal names so many units of a kind.
inline constexpr size_t kMostNamed = 20;

/// What the terminal shows of a plan's state.
std::string StateText(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::string& name);
/// The same as a page.
void WriteStatePage(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::filesystem::path& file);

}  // namespace oted::cli
