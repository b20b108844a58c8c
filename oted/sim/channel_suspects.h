#pragma once
/// What is often off between controller and plant, beside the parameters that are searched.

#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

/// The delay of actions, that of all rates together (as far as a pattern names them), and the zero of every angle and
/// length, and its scale. What a searched parameter sets is left out, and an action delay beside a searched lag of all
/// sensors, which no log tells apart. None where observations are images or actions are no quantities.
std::vector<ParameterSpec> ChannelSuspects(const SimulatorSpec& spec, const ParameterSpace& searched);

/// One of them for each action alone, where it is a delay of several.
std::vector<ParameterSpec> PartsOfChannelSuspect(const SimulatorSpec& spec, const ParameterSpec& suspect);

}  // namespace oted
