#pragma once
/// What the simulator may have wrong beside the parameters that are searched. Not in the paper.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/prior.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// A score test of each of the factory's Suspects in turn: one Newton step on it and on x together, from what the
/// windows' derivatives say (as LevelFit::Finish). Those that would change by more than a tenth and by more than four
/// standard deviations, the most certain first, three at most. Each stands for itself: what one explains another often
/// explains nearly as well. Told by a linear model from the nominal value: factors far from 1 are rough.
/// @param fit    after Finish
/// @param prior  of x
std::vector<Suspect> FindSuspects(const SimulatorFactory& factory, const Dataset& dataset, const LevelFit& fit,
                                  const Prior& prior, int n_threads);

}  // namespace oted
