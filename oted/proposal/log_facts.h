#pragma once
/// What the logs of a task say about it: how much moves, and what does not fit the model.

#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/sim/mujoco/model_outline.h"
#include "oted/sim/simulator.h"

namespace oted {

/// 0.0437 -> 0.05: one digit, upwards. Of a positive number.
double RoundedUp(double value);

/// The log as one that shows `names` would be, velocities of its positions from differences: good enough to see what a
/// parameter does. Nothing where a name is neither there nor such a velocity.
std::optional<Dataset> WithVelocities(const Dataset& dataset, const std::vector<std::string>& has,
                                      const std::vector<std::string>& names, double period_s);

/// What is suspicious beside the findings of CheckDataset, with what to do, a sentence each: signs, zeros and units
/// that the model contradicts, joint limits, actions that act later.
/// @param dataset  of the task `factory` is of, with its period
std::vector<std::string> SuspiciousFacts(const SimulatorFactory& factory, const Dataset& dataset,
                                         const ModelOutline& model, const RunContext& context);

}  // namespace oted
