#pragma once
/// What suspects buy when they are searched as well: each is freed, fitted and judged by prediction. Not in the paper.

#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/prior.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/trajectories/trial_keeper.h"

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
  TrialKeeper& keeper;  ///< of each step that is done
};

/// Of the factory's Suspects, those that nobody searches and that the logs ask to be other than they are. Each is taken
/// alone: what one explains, another often explains nearly as well.
///
/// Which are likely. The parameters are fitted to short windows (some 0.06 s, four to eight steps) of the logs that
/// were not kept aside. A score test there asks each suspect, and of those that are of several joints, drives, tendons
/// or bodies each of these. The eight that it favours, and parts that stand out, are fitted with the parameters to the
/// same windows. Those that make the windows likelier beyond chance, and whose value is noticeable, are ranked by how
/// much. If there are none, windows that grow from the short ones to a quarter second are fitted with each of a dozen;
/// not if `n` is 0, as it takes long. Where the design took long windows, windows of up to a quarter second are fitted
/// with each of a dozen, and with those that stand out in short ones.
///
/// What they are worth. The first `n` are fitted with the parameters, from where the design ended, to windows of 0.1 to
/// 0.5 s, as long as the design's. Each such fit and the design without the suspect predict the part that was kept
/// aside; that design is the found one, or one fitted to the same windows if it predicts better. Predictions from noisy
/// starts differ little between a good simulator and a better one. So it also counts how much likelier a suspect makes
/// windows whose starts are fitted: FreedTrial::kept says how.
///
/// @return the likeliest first, `n` and at least three at most; one whose simulator cannot be fitted stays untried
/// @throws Interrupted when a stop was requested
std::vector<Suspect> TrySuspects(const FreedProblem& problem, int n);

/// The same of those that the design's own windows ask, where its predictions leave nothing for others to explain.
std::vector<Suspect> TryAsked(const FreedProblem& problem, int n);

}  // namespace oted
