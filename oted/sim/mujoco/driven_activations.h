#pragma once
/// Activations that follow the commands alone: MuJoCo's filters of first order, such as a servo's lag. No log shows
/// them, and none needs to: what was commanded before a state says where they are in it.

#include <mujoco/mujoco.h>

#include <functional>
#include <span>
#include <vector>

#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/parameter_space.h"

namespace oted {

struct DrivenActivation {
  int act = 0;       ///< entry of mjData's act
  int actuator = 0;  ///< whose dynprm[0] is its time constant [s]
  int action = 0;    ///< entry of the task's actions
};

/// Those whose control is one of `controls` (entries of mjData's ctrl, one per action) and that `is_seen` leaves.
std::vector<DrivenActivation> DrivenActivations(const mjModel& model, const std::vector<int>& controls,
                                                const std::function<bool(int act)>& is_seen);

/// Control steps of `period_s` after which a filter has forgotten where it began, but for a hundredth, at any value of
/// the parameters `fields` of `specs`. 0 for none.
int StepsToForget(const mjModel& model, const std::vector<DrivenActivation>& driven,
                  const std::vector<ModelField>& fields, const std::vector<ParameterSpec>& specs, double period_s);

/// What was commanded, oldest first: each row of `actions` (n, act_dim) for `n_steps` time steps.
struct Commands {
  std::span<const double> actions;
  int act_dim = 0;
  int n_steps = 1;
};

/// Where a filter that was at `act` is after the commands.
/// @param time_constant  [s]
double ActivationAfter(const mjModel& model, const DrivenActivation& driven, double time_constant, double act,
                       const Commands& commands);

}  // namespace oted
