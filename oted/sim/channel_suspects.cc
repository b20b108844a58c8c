#include "oted/sim/channel_suspects.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "oted/base/error.h"
#include "oted/sim/channel_path.h"

namespace oted {
namespace {

constexpr double kLongest = 3.0;                  // [control steps]
constexpr double kLongestSeconds = 0.03;          // [s]: of actions, where that is more
constexpr double kLongestOfPositions = 0.05;      // [s]: the same of a camera
constexpr double kFarthest = 0.3;                 // [rad], [m]: of a sensor's zero
constexpr double kFarthestRate = 1.0;             // [rad/s], [m/s]: the same of a gyroscope
constexpr size_t kMostLatePositions = 16;         // whose lags are suspected one by one
constexpr size_t kMostLateActions = 16;           // whose delays are
constexpr size_t kMostScales = 16;                // of positions
constexpr double kMostScaled = 1.5;               // or its inverse
constexpr const char* kRates = "obs/*vel/delay";  // what Gymnasium and models call them

ParameterSpec Spec(const std::string& name, const std::string& path, double low, double high) {
  return {.name = name, .field = path, .low = low, .high = high, .scale = ParameterScale::kAbsolute};
}

/// Observations in one of these units, by name.
std::vector<std::string> ObservationsIn(const SimulatorSpec& spec, const std::array<std::string, 2>& units) {
  std::vector<std::string> names;
  for (size_t j = 0; j < std::min(spec.observation_names.size(), spec.observation_units.size()); ++j) {
    if (std::ranges::find(units, spec.observation_units[j]) != units.end()) names.push_back(spec.observation_names[j]);
  }
  return names;
}

/// Of a position and of the velocity that is its rate.
ParameterSpec ScaleOf(const SimulatorSpec& spec, const std::string& position) {
  std::string field = fmt::format("obs/{}/scale", position);
  for (size_t j = 0; j < std::min(spec.rate_of.size(), spec.observation_names.size()); ++j) {
    const int source = spec.rate_of[j];
    if (source < 0 || spec.observation_names[static_cast<size_t>(source)] != position) continue;
    field += fmt::format(" + obs/{}/scale", spec.observation_names[j]);
  }
  return {
      .name = position + "_scale", .field = field, .low = 1 / kMostScaled, .high = kMostScaled, .logarithmic = true};
}

}  // namespace

std::vector<ParameterSpec> ChannelSuspects(const SimulatorSpec& spec, const ParameterSpace& searched) {
  if (spec.observation_shape.size() != 1 || spec.n_discrete_actions > 0 || !(spec.control_period_s > 0)) return {};
  const auto longest = [&](double seconds) { return std::max(kLongest, std::ceil(seconds / spec.control_period_s)); };
  std::vector<ParameterSpec> candidates = {Spec("delay", "action/delay", 0, longest(kLongestSeconds))};
  candidates.push_back(Spec("rates_delay", kRates, 0, kLongest));
  const auto suspect_zero = [&](const std::string& name, double farthest) {
    candidates.push_back(Spec(name + "_bias", fmt::format("obs/{}/bias", name), -farthest, farthest));
  };
  const std::vector<std::string> positions = ObservationsIn(spec, {"rad", "m"});
  for (const std::string& name : positions) suspect_zero(name, kFarthest);
  for (const std::string& name : ObservationsIn(spec, {"rad/s", "m/s"})) suspect_zero(name, kFarthestRate);
  // An encoder's ratio is that of its velocity as well.
  if (positions.size() <= kMostScales) {
    for (const std::string& name : positions) candidates.push_back(ScaleOf(spec, name));
  }
  // All that is read late is an action's delay, one position alone is none: a camera beside an encoder.
  if (spec.obs_dim() > 1 && positions.size() <= kMostLatePositions) {
    for (const std::string& name : positions) {
      candidates.push_back(Spec(name + "_delay", fmt::format("obs/{}/delay", name), 0, longest(kLongestOfPositions)));
    }
  }
  std::vector<ChannelField> taken;
  for (const ParameterSpec& parameter : searched.specs()) {
    if (IsChannelPath(parameter.field)) taken.push_back(ResolveChannel(spec, parameter.field));
  }
  const auto is_set = [&](const ChannelField& field) {
    return std::ranges::any_of(taken, [&](const ChannelField& other) {
      const bool delays = field.quantity == ChannelQuantity::kActionDelay &&
                          other.quantity == ChannelQuantity::kObservationDelay &&
                          static_cast<int>(other.channels.size()) == spec.obs_dim();
      if (other.quantity != field.quantity) return delays;
      return std::ranges::any_of(field.channels,
                                 [&](int j) { return std::ranges::find(other.channels, j) != other.channels.end(); });
    });
  };
  std::vector<ParameterSpec> suspects;
  for (ParameterSpec& candidate : candidates) {
    try {
      if (is_set(ResolveChannelParameter(spec, candidate))) continue;
    } catch (const UsageError&) {
      continue;  // no rate has such a name
    }
    suspects.push_back(candidate);
  }
  return suspects;
}

std::vector<ParameterSpec> PartsOfChannelSuspect(const SimulatorSpec& spec, const ParameterSpec& suspect) {
  const ChannelField field = ResolveChannel(spec, suspect.field);
  const size_t n = field.channels.size();
  if (field.quantity != ChannelQuantity::kActionDelay || n < 2 || n > kMostLateActions) return {};
  std::vector<ParameterSpec> parts;
  for (const ParameterPlace& place : DescribeChannel(spec, suspect.field).places) {
    const size_t first = place.path.find('/') + 1, last = place.path.rfind('/');
    ParameterSpec part = Spec(place.path.substr(first, last - first) + "_delay", place.path, suspect.low, suspect.high);
    ResolveChannelParameter(spec, part);
    parts.push_back(part);
  }
  return parts;
}

}  // namespace oted
