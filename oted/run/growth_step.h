#pragma once
/// What a design's parameters lack: suspects are tried, and with design.grow the best of them join the parameters.

#include <vector>

#include "oted/run/design_findings.h"
#include "oted/run/run_setup.h"

namespace oted {

/// What the fit that tells of the whole suspects, tried; none where it leaves no more than the sensors explain, or
/// where a parameter ends at a bound: what that may not do others seem to ask for.
std::vector<Suspect> SuspectsOf(const RunSetup& run, const DesignFindings& findings);

/// With design.grow: up to kMostRounds times, one design by the first setting, its suspects tried, and the one that
/// gained most, if any surely did, added to run's parameters. Each round leaves growth/ROUND/growth.json.
void Grow(RunSetup& run);
inline constexpr int kMostRounds = 3;

/// Whether no round is left: one added nothing, or the most were made, or the run does not grow.
bool IsGrown(const RunSetup& run);

/// The same, as far as the rounds are complete: what a stopped or finished run goes on with. Makes nothing.
void TakeFinishedGrowth(RunSetup& run);

}  // namespace oted
