#pragma once
/// Where the trials of suspects keep what they have, so that a design that was stopped goes on. Not in the paper.

#include <Eigen/Dense>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/trajectories/unseen_likelihood.h"

namespace oted {

/// The suspects that the logs ask for, the likeliest first, none of them tried.
struct ScreenedSuspects {
  std::vector<Suspect> suspects;
  /// Of each suspect that windows were fitted with, by name: x of the parameters and of the suspect.
  std::map<std::string, Eigen::VectorXd> x_with;
};

/// What makes the windows of the logs how likely where a suspect is free.
struct TrialCosts {
  WindowCosts of_windows;
  std::vector<int> ages;  ///< ReadingModel::ages: fits with other sensors late held other readings
};

struct TriedSuspect {
  std::optional<FreedTrial> trial;  ///< none where its simulator cannot be fitted
  std::optional<TrialCosts> costs;  ///< none where they are not known
};

/// Gives what was kept, and else what `make` gives, which it may keep. This one keeps nothing.
class TrialKeeper {
 public:
  virtual ~TrialKeeper() = default;
  virtual ScreenedSuspects Screened(const std::function<ScreenedSuspects()>& make) { return make(); }
  /// @param number  of the trial, from 1
  virtual TriedSuspect Tried(int /*number*/, const std::function<TriedSuspect()>& make) { return make(); }
};

}  // namespace oted
