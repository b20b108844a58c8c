#pragma once
/// What `oted data` shows on the terminal.

#include <string>
#include <vector>

#include "oted/checks/data_check.h"
#include "oted/data/describe.h"

namespace oted::cli {

/// @param spec  of the task, or null
void PrintDataInfo(const Dataset& dataset, const std::string& format, const SimulatorSpec* spec,
                   const DatasetSummary& summary);
void PrintDataCheck(const Dataset& dataset, const SimulatorSpec* spec, const DataCheck& check);

}  // namespace oted::cli
