#pragma once
/// What a task adds to the physics: its start states, what it shows, what it pays and when it ends. MujocoSimulator
/// does the rest, the same for every task.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/rng.h"

namespace oted {

/// One array of mjData (or one part of the state) of every lane; lanes are `stride` numbers apart.
struct LaneArray {
  double* first = nullptr;
  int size = 0;
  int stride = 0;
  std::span<double> row(int lane) const {
    return {first + static_cast<ptrdiff_t>(lane) * stride, static_cast<size_t>(size)};
  }
};

/// One lane's numbers after its last call: row i is what TaskRules::arrays() names i-th.
class LaneView {
 public:
  LaneView(std::span<const LaneArray> arrays, int lane) : arrays_(arrays), lane_(lane) {}
  std::span<const double> operator[](size_t i) const { return arrays_[i].row(lane_); }

 private:
  std::span<const LaneArray> arrays_;
  int lane_;
};

/// The parts of one lane's state that a task may write.
struct LaneState {
  std::span<double> qpos, qvel;
  std::span<double> act;  ///< activations of actuators; often none
};

struct StepOutcome {
  double reward = 0;
  bool terminated = false;
};

/// One object per simulator; called from one thread. `memory` is memory_size() numbers of a lane that the rules keep
/// from one control step to the next.
class TaskRules {
 public:
  virtual ~TaskRules() = default;

  /// The arrays that the rules read: "qpos", "qvel", "act", or mjData's names ("site_xpos", "sensordata").
  virtual const std::vector<std::string>& arrays() const = 0;
  /// mjtStage up to which MuJoCo computes after the physics steps, so that those arrays belong to the new state.
  virtual int stage() const = 0;
  virtual int memory_size() const = 0;

  /// Makes a start state from the fixed one that `state` holds.
  virtual void DrawStart(Rng& rng, const LaneState& state) const = 0;
  /// Whether these numbers determine a state.
  virtual bool Determines(std::span<const double> observation) const = 0;
  /// Writes it over the fixed start state that `state` holds.
  virtual void SetState(std::span<const double> observation, const LaneState& state) const = 0;

  /// Writes the coordinates that no observation shows, SimulatorSpec::hidden. Call SetState behind it.
  virtual void SetHidden(std::span<const double> hidden, const LaneState& state) const {
    static_cast<void>(hidden);
    static_cast<void>(state);
  }

  /// An episode begins.
  virtual void Begin(const LaneView& view, std::span<double> memory) = 0;
  /// A control step is over. @param time since the episode began, after the step [s]
  virtual StepOutcome Finish(const LaneView& view, std::span<const double> action, double time,
                             std::span<double> memory) = 0;
  virtual void Observe(const LaneView& view, std::span<double> observation) const = 0;
  /// Whether an episode ends in this state by the task's own rule; nothing where that takes more than the state.
  virtual std::optional<bool> Ends(const LaneView& view) const {
    static_cast<void>(view);
    return std::nullopt;
  }
};

}  // namespace oted
