#pragma once
/// What no derivative tells of: what the robot touches may stand where the model touches nothing, and a drive may
/// saturate below any force that the model asks of it. Not in the paper.

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// Whether the model has a suspect's lowest value, or nearly: none of a friction, say, or next to none.
bool IsAtLowEnd(const ParameterSpec& spec);
/// Whether a suspect is a value on both sides of the model's: a place, a zero. What it does may begin at a distance.
bool IsShift(const ParameterSpec& spec);
/// Whether it is where something stands: a coordinate of a body or of a geom.
bool IsPlace(const ParameterSpec& spec);

/// Whether it is the largest force that a drive or a joint exerts.
bool IsLimit(const ParameterSpec& spec);
/// Whether what it does may begin at a distance alone: a place, a limit.
bool IsDistant(const ParameterSpec& spec);

/// Each of `specs`, which are distant, at some values off in both directions, in the windows that the fit explains
/// worst.
/// @param fit    after FinalCost
/// @param wider  of a simulator that has `specs` behind the parameters of x
/// @return those with a value that makes these windows surely likelier, and by how many nats; the surest first
std::vector<Suspect> FindDistant(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider);

/// The same of those that are searched. @return x with the one moved that these windows ask for most; none where they
/// surely ask for none
/// @param explained_alone  whether windows count that become explained, and none that is only less far off
std::optional<Eigen::VectorXd> WithDistantMoved(const LevelFit& fit, const ParameterSpace& space, bool explained_alone);

}  // namespace oted
