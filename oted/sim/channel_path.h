#pragma once
/// Paths of parameters between controller and plant: "action/delay" of all actions, "action/NAME/delay",
/// "obs/NAME/noise_std", "obs/NAME/bias", "obs/NAME/scale", "obs/NAME/delay". NAME is an action's or observation's
/// name, with * and ?, or its number ("#3", or "3"). Several that are tied are joined by " + ".

#include <string>
#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

enum class ChannelQuantity {
  kActionDelay,       ///< [control steps]
  kNoiseStd,          ///< standard deviation of white Gaussian noise [unit of the observation]
  kBias,              ///< added to the observation [unit of the observation]
  kScale,             ///< factor of the observation, nominally 1
  kObservationDelay,  ///< [control steps]
};

/// What one path stands for.
struct ChannelField {
  ChannelQuantity quantity = ChannelQuantity::kActionDelay;
  std::vector<int> channels;  ///< indices of actions for a delay of actions, else of observations; ascending
};

/// Whether the path's first word is "action" or "obs".
bool IsChannelPath(const std::string& path);
/// Whether it is "obs/NAME/noise_std".
bool IsSensorNoise(const std::string& path);
/// Whether it is "obs/NAME/bias".
bool IsSensorBias(const std::string& path);

/// Whether it is "obs/NAME/scale".
bool IsSensorScale(const std::string& path);

/// @throws UsageError saying which part of the path matches nothing, with the nearest name.
ChannelField ResolveChannel(const SimulatorSpec& spec, const std::string& path);

/// Resolves a parameter and completes it (nominal value and unit).
/// @throws UsageError also when a sensor's scale is not given in multiples, or anything else is; or the range does not
/// hold the nominal value, or holds negative delays, noise or scales.
ChannelField ResolveChannelParameter(const SimulatorSpec& spec, ParameterSpec& parameter);

PathInfo DescribeChannel(const SimulatorSpec& spec, const std::string& path);

/// The channel parameters of any simulator with flat observations.
std::vector<ParameterOffer> ChannelOffers(const SimulatorSpec& spec);

}  // namespace oted
