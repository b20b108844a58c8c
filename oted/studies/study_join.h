#pragma once
/// One study file of several.

#include <string>
#include <vector>

#include "oted/studies/study_file.h"

namespace oted {

/// Adds the cells of `parts` to those of `whole`, and their seeds to cells that are there. What two have must be the
/// same but for times. @param command  what the joined cells say they were made with
/// @throws DataError where cells differ in what all of their seeds have in common, or one seed has two results
void JoinStudies(const std::vector<StudyFile>& parts, const StudyFile& whole, const std::string& command);

}  // namespace oted
