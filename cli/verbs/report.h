#pragma once
/// oted report: the page and its JSON, from what a run directory holds.

#include "cli/program.h"

namespace oted::cli {

void AddReportVerb(Program& program);

}  // namespace oted::cli
