#pragma once
/// A design's verdict in one sentence, the same on the terminal, in design.json and on the report.

#include <string>
#include <vector>

#include "oted/run/design_record.h"

namespace oted {

/// Whether its value is at an end of its range, whatever its interval holds.
bool EndsAtBound(const DesignRecord::Parameter& p);

/// @param off  channels in which more is left than the sensors explain, the farthest off first
std::string VerdictSentence(const DesignRecord& record, const std::vector<int>& off);

}  // namespace oted
