#pragma once
/// Hopper, HalfCheetah and Walker2d as TaskRules: every floating-point operation in Gymnasium's order.

#include "oted/sim/mujoco/task.h"
#include "oted/sim/mujoco/task_rules.h"

namespace oted {

/// Shows (qpos without the root's x, qvel), pays forward speed + healthy bonus - control cost.
class GymnasiumRules : public TaskRules {
 public:
  /// @param task must outlive this object
  GymnasiumRules(const MujocoTask& task, double control_period) : task_(task), control_period_(control_period) {}

  const std::vector<std::string>& arrays() const override;
  int stage() const override;
  int memory_size() const override { return 1; }  // the root's x before the step
  void DrawStart(Rng& rng, const LaneState& state) const override;
  /// False when a velocity lies on the clip (|v| >= 10 where the task clips) or a number is not finite.
  bool Determines(std::span<const double> observation) const override;
  /// The root's x, which no observation shows, becomes 0.
  void SetState(std::span<const double> observation, const LaneState& state) const override;
  void Begin(const LaneView& view, std::span<double> memory) override;
  StepOutcome Finish(const LaneView& view, std::span<const double> action, double time,
                     std::span<double> memory) override;
  void Observe(const LaneView& view, std::span<double> observation) const override;
  std::optional<bool> Ends(const LaneView& view) const override;

 private:
  const MujocoTask& task_;
  double control_period_;
};

}  // namespace oted
