#include "oted/sim/mujoco/gymnasium_rules.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr size_t kQpos = 0, kQvel = 1;

bool IsHealthy(const MujocoTask& task, std::span<const double> qpos, std::span<const double> qvel) {
  if (!task.healthy_height.Contains(qpos[1]) || !task.healthy_angle.Contains(qpos[2])) return false;
  const auto contained = [&](double v) { return task.healthy_remainder.Contains(v); };
  return std::all_of(qpos.begin() + 2, qpos.end(), contained) && std::all_of(qvel.begin(), qvel.end(), contained);
}

}  // namespace

const std::vector<std::string>& GymnasiumRules::arrays() const {
  static const std::vector<std::string> names = {"qpos", "qvel"};
  return names;
}

int GymnasiumRules::stage() const { return mjSTAGE_NONE; }

// Gymnasium calls mj_forward after this; that changes no number of the state (the warm start is stored by mj_step
// alone).
void GymnasiumRules::DrawStart(Rng& rng, const LaneState& state) const {
  const double scale = task_.reset_noise_scale;
  const bool normal = task_.reset_noise == ResetNoise::kUniformPositionsNormal;
  for (double& q : state.qpos) q += rng.Uniform(-scale, scale);
  for (double& v : state.qvel) v += normal ? scale * rng.Normal() : rng.Uniform(-scale, scale);
}

bool GymnasiumRules::Determines(std::span<const double> observation) const {
  // (qpos without its first number, qvel), and these models have one velocity per position.
  const size_t n_positions = observation.size() / 2;
  const double clip = task_.velocity_clip;
  const auto finite = [](double v) { return std::isfinite(v); };
  const auto determined = [&](double v) { return std::isfinite(v) && std::abs(v) < clip; };
  const auto velocities = observation.subspan(n_positions);
  return std::all_of(observation.begin(), observation.begin() + static_cast<ptrdiff_t>(n_positions), finite) &&
         std::all_of(velocities.begin(), velocities.end(), determined);
}

void GymnasiumRules::SetState(std::span<const double> observation, const LaneState& state) const {
  const std::span<const double> positions = observation.first(state.qpos.size() - 1);
  const std::span<const double> velocities = observation.last(state.qvel.size());
  state.qpos[0] = 0;
  std::copy(positions.begin(), positions.end(), state.qpos.begin() + 1);
  std::copy(velocities.begin(), velocities.end(), state.qvel.begin());
}

void GymnasiumRules::Begin(const LaneView& view, std::span<double> memory) { memory[0] = view[kQpos][0]; }

StepOutcome GymnasiumRules::Finish(const LaneView& view, std::span<const double> action, double /*time*/,
                                   std::span<double> memory) {
  const bool healthy = !task_.terminates || IsHealthy(task_, view[kQpos], view[kQvel]);
  const double x_velocity = (view[kQpos][0] - memory[0]) / control_period_;
  memory[0] = view[kQpos][0];
  double sum_of_squares = 0;
  for (double a : action) sum_of_squares += a * a;
  const double control_cost = task_.control_cost_weight * sum_of_squares;
  const double healthy_reward = healthy || task_.healthy_on_terminal ? task_.healthy_reward : 0.0;
  return {.reward = task_.forward_weight * x_velocity + healthy_reward - control_cost, .terminated = !healthy};
}

void GymnasiumRules::Observe(const LaneView& view, std::span<double> observation) const {
  const std::span<const double> positions = view[kQpos].subspan(1);
  const double clip = task_.velocity_clip;
  const auto next = std::copy(positions.begin(), positions.end(), observation.begin());
  std::transform(view[kQvel].begin(), view[kQvel].end(), next, [&](double v) { return std::clamp(v, -clip, clip); });
}

std::optional<bool> GymnasiumRules::Ends(const LaneView& view) const {
  return task_.terminates && !IsHealthy(task_, view[kQpos], view[kQvel]);
}

}  // namespace oted
