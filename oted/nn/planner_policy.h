#pragma once
/// A policy that plans: model-based offline planning (MBOP; Argenson and Dulac-Arnold 2021). At every control step it
/// simulates trajectories by learned models and executes the first action of their weighted mean.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/data/normalizer.h"
#include "oted/data/npz.h"
#include "oted/nn/mlp.h"
#include "oted/nn/policy.h"

namespace oted {

struct PlanOptions {
  int horizon = 8;         ///< H, control steps of a plan
  int trajectories = 200;  ///< N for each plan
  double noise = 0.1;      ///< sigma: deviation of an action from the prior's, of actions in [-1, 1]
  double keep = 0;         ///< beta: share of the former plan in each action
  double sharpness = 0.1;  ///< kappa: a trajectory's weight is exp(kappa R), R in the reward's units
};

/// One member of the ensembles; all three share their hidden layers' widths. Inputs and outputs in normalised units,
/// but actions in [-1, 1].
struct PlannerMember {
  Mlp dynamics;  ///< (s, a) -> (s', r)
  Mlp prior;     ///< (s, former a) -> a
  Mlp value;     ///< (s, a) -> R, the sum of the next H rewards
};

/// Numbers are in normalised units x = (raw - mean) / scale.
struct PlannerUnits {
  Normalizer observation;
  double reward_mean = 0, reward_scale = 1;
  double value_mean = 0, value_scale = 1;
  std::vector<double> action_low, action_high;
};

/// Algorithm 2 of the paper. Trajectory n uses member n mod K all along, so that the ensemble's spread is the plans'.
/// At an episode's first step the former plan is zero. Actions are clipped to their range before a model sees them.
/// Models know no end of an episode.
class PlannerPolicy : public Policy {
 public:
  /// The array that tells a file of this kind.
  static constexpr const char* kMark = "planner/plan";

  PlannerPolicy(std::vector<PlannerMember> members, PlannerUnits units, const PlanOptions& options);

  int obs_dim() const override { return static_cast<int>(units_.observation.mean.size()); }
  int act_dim() const override { return static_cast<int>(units_.action_low.size()); }
  /// An actor that plans for rows of observations, each row's plan remembered (PolicyActor::Begin, Keep). Planning
  /// draws either way; `noise` and `noise_scale` change nothing.
  std::unique_ptr<PolicyActor> MakeActor(ActionNoise noise, double noise_scale = 1.0) const override;
  bool has_onnx() const override { return false; }
  void Save(const std::filesystem::path& path) const override;
  /// What was read from `path`. @throws DataError
  static PlannerPolicy FromArrays(const NpzArrays& arrays, const std::filesystem::path& path);

  const std::vector<PlannerMember>& members() const { return members_; }
  const PlannerUnits& units() const { return units_; }
  const PlanOptions& options() const { return options_; }

 private:
  std::vector<PlannerMember> members_;
  PlannerUnits units_;
  PlanOptions options_;
};

}  // namespace oted
