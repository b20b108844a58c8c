#pragma once
/// Velocities that a log shows later than the positions that they belong to: servos that filter or queue them.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// (obs_dim): how many control steps late each rate is, 0 where it is not: the lag, of 0, 1, ... up to 0.1 s, at which
/// differences of the logged positions are nearest to it, if they are surely nearer than without one. 0 for a channel
/// whose delay is known or searched (SimulatorSpec::reading_ages), and where the logs are too short to tell.
std::vector<int> LateRates(const SimulatorSpec& spec, const Dataset& dataset);

}  // namespace oted
