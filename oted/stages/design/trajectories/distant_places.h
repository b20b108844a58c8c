#pragma once
/// Places that no derivative tells of: what the robot touches may stand where the model touches nothing. Not in the
/// paper.

#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// Whether a suspect is where something stands: a coordinate of a body or of a geom, on both sides of the model's.
bool IsPlace(const ParameterSpec& spec);

/// Each of `places` some distances off in both directions, in the windows that the fit explains worst.
/// @param fit    after FinalCost
/// @param wider  of a simulator that has `places` behind the parameters of x
/// @return those with a value that makes these windows surely likelier, and by how many nats; the surest first
std::vector<Suspect> FindDistantPlaces(const std::vector<ParameterSpec>& places, const LevelFit& fit,
                                       WindowReplayer& wider);

}  // namespace oted
