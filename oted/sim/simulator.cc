#include "oted/sim/simulator.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {

int SimulatorSpec::obs_dim() const {
  int size = 1;
  for (int extent : observation_shape) size *= extent;
  return observation_shape.empty() ? 0 : size;
}

double SimulatorSpec::NormalizedScore(double episode_return) const {
  OTED_CHECK(has_score());
  return 100.0 * (episode_return - return_random) / (return_expert - return_random);
}

void Simulator::ResetTo(int, std::span<const double>, std::span<const double>, Rng&) {
  throw UsageError(
      fmt::format("task '{}' has no positions and velocities to start from; reset it without them", spec().task));
}

double SimulatorSpec::MeanAction(size_t k, double before, double now, double share) const {
  const bool is_bounded = bounds_action.empty() || bounds_action[k] != 0;
  const auto bounded = [&](double a) { return is_bounded ? std::clamp(a, action_low[k], action_high[k]) : a; };
  return share * bounded(before) + (1 - share) * bounded(now);
}

void Simulator::StepLate(std::span<const int> lanes, std::span<const double> actions, const LateActions& late) {
  const size_t act_dim = static_cast<size_t>(spec().act_dim);
  std::vector<double> mean(actions.begin(), actions.end());
  for (const int lane : lanes) {
    for (size_t k = 0; k < act_dim; ++k) {
      const size_t i = static_cast<size_t>(lane) * act_dim + k;
      if (late.share[i] != 0) mean[i] = spec().MeanAction(k, late.before[i], actions[i], late.share[i]);
    }
  }
  Step(lanes, mean);
}

void Simulator::TakeTaskPolicy(TaskPolicy, int, Rng&, std::span<double>) const {
  throw UsageError(fmt::format("task '{}' has no policy of its own; give a policy file", spec().task));
}

PathInfo SimulatorFactory::Describe(const std::string& path) const {
  for (const ParameterSpec& parameter : parameters().specs()) {
    if (parameter.field == path) return {{{path, parameter.nominal}}, parameter.unit, "declared by the simulator"};
  }
  throw UsageError(fmt::format("parameter path '{}' names nothing in simulator '{}'", path, spec().task));
}

std::unique_ptr<Renderer> SimulatorFactory::MakeRenderer(int, int, std::string* why_not) const {
  *why_not = fmt::format("task '{}' cannot be drawn: its simulator has no renderer", spec().task);
  return nullptr;
}

std::string SimulatorFactory::Mjcf(std::span<const double>, const std::string&, std::span<const double>) const {
  throw UsageError(fmt::format("task '{}' is no MuJoCo model and has no MJCF; write its q(z) with --q", spec().task));
}

}  // namespace oted
