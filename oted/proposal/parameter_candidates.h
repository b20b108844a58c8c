#pragma once
/// The numbers of a model that may be off, with ranges that the logs give.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/mujoco/model_outline.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Everything that the model has, in the order of how often it is off. Dry friction, damping, armature, strength of the
/// drives, masses, contact friction and the delay of actions: of each joint where few move, otherwise of all at once;
/// of tendons that a drive pulls. Ranges are multiples of nominal, or go up to what the logs can mean where the model
/// has nothing: a share of the forces that acted, at the speeds that were reached.
/// @param left_out  takes "name: why" of what the logs rule out
std::vector<ParameterSpec> ParameterCandidates(const SimulatorFactory& nominal, const Dataset& dataset,
                                               const ModelOutline& model, std::vector<std::string>& left_out);

}  // namespace oted
