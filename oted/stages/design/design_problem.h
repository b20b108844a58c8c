#pragma once
/// What a design starts from and what it leaves.

#include <filesystem>
#include <optional>
#include <string>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/fit_evidence.h"
#include "oted/nn/policy.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/simulator.h"

namespace oted {

/// One design: one setting, one seed. What it refers to must outlive it.
struct DesignProblem {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Policy* clone;  ///< may be null unless DesignConfig::UsesClone
  RngKey key;
  /// Algorithm 1 leaves checkpoint.npz there every ten iterations; a stopped run goes on from it with equal results.
  std::filesystem::path folder;
  std::string run_name;  ///< of curves and progress
  const RunContext& context;
  /// Which logs are kept aside.
  RngKey KeptAsideKey() const { return key.Stage("kept aside"); }
  bool judged = true;  ///< false: nobody asks for the evidence (DesignResult::fit) of a trial
};

struct DesignResult {
  Designer q;
  std::optional<Discriminator> g = {};           ///< only of Algorithm 1
  std::optional<double> learning_progress = {};  ///< mean of -log(1 - g) on all experience (Sec. 5.1)
  std::optional<TanhGaussianPolicy> clone = {};  ///< as joint training left it; only with clone_updates
  std::optional<FitEvidence> fit = {};           ///< what is left unexplained; only of methods that replay windows
};

}  // namespace oted
