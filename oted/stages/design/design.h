#pragma once
/// Stage 2 (paper, Sec. 4.1, Algorithm 1): learn q(z) and g by distribution matching.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/fit_evidence.h"
#include "oted/nn/policy.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/design_config.h"

namespace oted {

struct DesignResult {
  Designer q;
  Discriminator g;
  double learning_progress = 0;             ///< mean reward over all iterations (Sec. 5.1's "learning progress")
  std::optional<TanhGaussianPolicy> clone;  ///< as joint training left it; only with design.clone_updates
  std::optional<FitEvidence> fit;           ///< what is left unexplained; only of forms that replay windows
};

/// q(z) by the form that `config` names, and a discriminator g trained against it (the paper's score c(h) is g's):
///   "trajectories"          MatchTrajectories, then lines 1, 2 and 4 of Algorithm 1 with that q
///   "least-squares"         FitLeastSquares, then the same
///   "dropo"                 FitDropo, then the same
///   "images"                MatchRatios, then the same
///   "transitions", "paper"  Algorithm 1
/// @param config  resolved: its form is not "auto"
/// @param clone   may be null when config replays actions
/// @param folder  Algorithm 1 leaves checkpoint.npz there every ten iterations; a stopped run goes on from it with
///                equal results. The other forms, which take seconds, begin anew
/// @throws Interrupted when a stop was requested
DesignResult LearnDesign(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                         const DesignConfig& config, RngKey key, const std::filesystem::path& folder,
                         const std::string& run_name, const RunContext& context);

}  // namespace oted
