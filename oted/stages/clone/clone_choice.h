#pragma once
/// clone.method = "auto": behavioural cloning or ValueDICE, by evidence that needs no target.

#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"
#include "oted/stages/clone/clone.h"

namespace oted {

/// Both methods learn from four fifths of the logs: whole episodes, where there are two. Two things are compared:
///   - how likely each finds the actions of the held-out episodes;
///   - how hard the experience of each, acting in M(nominal) from its own starts, is to tell from as many first steps
///     of the logged episodes, by a judge that is tested on what it was not trained on (oted/matching/judge.h). What
///     the nominal simulator gets wrong counts against both.
/// ValueDICE is taken where its experience is harder to tell by more than kMargin; without a simulator, where it finds
/// the held-out actions likelier. What is taken learns from all the logs, as it would have by its own name.
/// @param judge_steps  gradient steps of each judge
CloneResult ChooseClone(const CloneJob& job, int judge_steps = 200);

/// Of a judge's score [nats]: what another seed of the judge changes.
inline constexpr double kMargin = 0.01;

}  // namespace oted
