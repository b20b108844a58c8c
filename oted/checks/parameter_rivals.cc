#include "oted/checks/parameter_rivals.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>

#include "oted/sim/channel_path.h"
#include "oted/stages/design/trajectories/distant_values.h"

namespace oted {
namespace {

constexpr std::array<double, 4> kFactors = {0.5, 0.7, 1.4, 2.0};
constexpr std::array<double, 8> kPlaceOff = {-0.4, -0.2, -0.1, -0.05, 0.05, 0.1, 0.2, 0.4};  // of half the range
constexpr std::array<double, 6> kSpringOff = {-0.5, -0.25, -0.1, 0.1, 0.25, 0.5};            // [rad], [m]

constexpr std::array<double, 3> kShares = {0.02, 0.1, 0.5};  // of the range of a spring that the model lacks

constexpr int kHalvings = 4;  // of the way from the nominal value to the best of them

/// Values to try; none of what a zero is not mistaken for.
std::vector<double> Tried(const ParameterSpec& spec) {
  std::vector<double> values;
  if (spec.IsMultiple() && !IsChannelPath(spec.field)) {
    for (const double factor : kFactors) values.push_back(factor * spec.nominal);
  } else if (spec.field.ends_with("/stiffness")) {
    for (const double share : kShares) values.push_back(spec.low + share * (spec.high - spec.low));
  } else if (spec.field.ends_with("/springref")) {
    for (const double off : kSpringOff) values.push_back(spec.nominal + off);
  } else if (IsShift(spec) && spec.field.find("pos[") != std::string::npos) {  // of a thing, or of a centre of mass
    for (const double off : kPlaceOff) values.push_back(spec.nominal + off * (spec.high - spec.low) / 2);
  }
  return values;
}

std::string InWords(const ParameterSpec& spec, double value) {
  return spec.IsMultiple() ? fmt::format("{} x {:.2g}", spec.field, value / spec.nominal)
                           : fmt::format("{} at {:.2g}", spec.field, value);
}

}  // namespace

ParameterRivals::ParameterRivals(const SimulatorFactory& factory, int n_threads) {
  std::vector<ParameterSpec> suspects = factory.Suspects();
  std::erase_if(suspects, [](const ParameterSpec& spec) { return Tried(spec).empty(); });
  if (suspects.empty()) return;
  wider_ = factory.With(suspects);
  if (wider_ != nullptr) replays_.emplace(*wider_, n_threads);
}

std::optional<ParameterRival> ParameterRivals::Best(const ReplayedWindows& windows, const std::vector<int>& judged,
                                                    double most, size_t stride) {
  if (!replays_) return std::nullopt;
  const ParameterSpace& space = wider_->parameters();
  const auto error_at = [&](int i, double value) {
    std::vector<double> z = space.Nominal();
    z[static_cast<size_t>(i)] = value;
    replays_->SetParameters(z);
    const std::optional<ChannelErrors> errors = replays_->Errors(windows, stride);
    return errors ? MeanOf(*errors, judged) : std::numeric_limits<double>::infinity();
  };
  int best = -1;
  double value = 0, error = std::numeric_limits<double>::infinity();
  for (int i = 0; i < space.size(); ++i) {
    for (const double tried : Tried(space[i])) {
      const double there = std::clamp(tried, space[i].low, space[i].high), left = error_at(i, there);
      if (left < error) std::tie(best, value, error) = std::tuple(i, there, left);
    }
  }
  if (best < 0) return std::nullopt;
  // Values lie far apart, and beside a change of columns that fits exactly all of them may be far off.
  const ParameterSpec& spec = space[best];
  double step = (value - spec.nominal) / 2;
  for (int halved = 0; halved < kHalvings; ++halved, step /= 2) {
    for (const double sign : {-1.0, 1.0}) {
      const double there = std::clamp(value + sign * step, spec.low, spec.high), left = error_at(best, there);
      if (left < error) std::tie(value, error) = std::tuple(there, left);
    }
  }
  if (!(error < most)) return std::nullopt;
  return ParameterRival{InWords(spec, value), error};
}

}  // namespace oted
