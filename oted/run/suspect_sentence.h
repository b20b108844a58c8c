#pragma once
/// A suspect and a condition in words, the same on the terminal, in design.json and on the report.

#include <string>
#include <vector>

#include "oted/run/design_record.h"

namespace oted {

/// What the logs say of a suspect, and what freeing it bought.
/// @param channels  of the predictions: names and units, and the floor where it is known
/// @param off       those in which more is left than the sensors explain, the farthest off first; the first is told of
std::string SuspectSentence(const Suspect& suspect, const std::vector<DesignRecord::Validation::Channel>& channels,
                            const std::vector<int>& off);

/// That --grow added one where the logs are as likely with another.
std::string RivalSentence(const Suspect& added, const Suspect& rival);

/// "actuator/*/gear[0] were 10 % more".
std::string ConditionInWords(const Condition& condition);

}  // namespace oted
