#pragma once
/// What suspects buy when they are searched as well: each is freed, fitted and judged by prediction. Not in the paper.

#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/prior.h"
#include "oted/sim/simulator.h"

namespace oted {

/// A finished design by trajectories that leaves more than the sensors explain. What it refers to must outlive the
/// call.
struct FreedProblem {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Prior& prior;
  const FitEvidence& fit;
  std::vector<double> z;  ///< what the design found
  RngKey kept_aside;      ///< which logs it kept aside
  const RunContext& context;
};

/// What is not searched and that the logs ask to be other than it is, of the factory's Suspects; each stands for
/// itself, and what one explains another often explains nearly as well.
///
/// Which are likely: short windows (some 0.06 s, four to eight steps) of the part of the logs that learns are fitted by
/// the parameters alone. The eight that a score test there favours are each fitted with the parameters to the same
/// windows; those that make them likelier beyond chance and are noticeable are ranked by how much. Where that names
/// none, or long windows took the place of short ones, a dozen are fitted to windows of up to a quarter second; in the
/// first case these grew from the short ones, and where `n` is 0 it is left out, as it takes long.
///
/// What they are worth: the first `n` are fitted with the parameters to windows as long as the design's, 0.1 to 0.5
/// s, of that part, from where the design ended. The design without is the better of that found and of one fitted to
/// the same windows. Both predict the part that was kept aside, from the same windows. Where windows are explained as
/// noise's (no long ones were taken), they are also asked how likely that part is: that tells of less than predictions
/// do, which from noisy starts differ little between a good simulator and a better one.
///
/// @return the likeliest first, `n` and at least three at most; one whose simulator cannot be fitted stays untried
/// @throws Interrupted when a stop was requested
std::vector<Suspect> TrySuspects(const FreedProblem& problem, int n);

/// Of those that are kept, the one that makes the logs that were kept aside likeliest; where none tells that, the one
/// that gains most. Null where none is kept.
const Suspect* BestFreed(const std::vector<Suspect>& suspects);

}  // namespace oted
