#pragma once
/// A proposal as the commented file that the user goes on with.

#include <string>

#include "oted/proposal/task_proposal.h"

namespace oted {

/// @param file  where it will stand: its paths are relative to there
std::string TaskText(const Proposal& proposal, const std::filesystem::path& file);

}  // namespace oted
