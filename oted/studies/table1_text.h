#pragma once
/// Table 1 as text: the paper's figures, ours beside them.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/studies/table1_study.h"

namespace oted {

/// Table 1 as Markdown, with the paper's own figures beside ours: D4RL's normalised scores, mean over seeds and, in
/// brackets, standard deviation and number of seeds. A line for each task, dataset and parameters of the study.
std::string Table1(const Table1Study& study, const std::vector<nlohmann::json>& records);

}  // namespace oted
