#pragma once
/// Minigrid's grid worlds as a Simulator: N lanes stepped together, discrete actions, images, a parameter that acts at
/// reset. Equal bytes at any number of threads.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/minigrid/grid.h"
#include "oted/sim/minigrid/task.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What the simulators of one factory share, read-only.
struct MinigridSetup {
  MinigridTask task;
  minigrid::Rules rules;
  SimulatorSpec spec;
  ParameterSpace space;
};

/// The observation is the image, flattened [x][y][channel], and then the direction (0 to 3). A lane's state cannot be
/// set from an observation, which does not show the whole grid. An action is the index of Minigrid's, one number.
///
/// A lane in which both the goal was reached and the clock ran out is kTerminated. A step past the end goes on moving
/// and reports what that step alone would, as Minigrid does.
class MinigridSimulator : public Simulator {
 public:
  MinigridSimulator(std::shared_ptr<const MinigridSetup> setup, int n_lanes, int n_threads);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  int n_lanes() const override { return observations_.rows(); }

  void SetParameters(int lane, std::span<const double> z) override;
  /// Moving balls take their moves from a stream that this draw of `rng` names.
  void Reset(int lane, Rng& rng) override;
  /// @throws UsageError always: spec().can_set_state is false.
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  /// @throws UsageError when an action is no index below spec().n_discrete_actions; no lane moves then.
  void Step(std::span<const int> lanes, std::span<const double> actions) override;

  std::span<const double> observation(int lane) const override;
  double reward(int lane) const override { return At(lane).reward; }
  LaneStatus status(int lane) const override { return At(lane).status; }

  /// Shortest paths for someone who sees the whole grid (oted/sim/minigrid/expert.h).
  void TakeTaskPolicy(TaskPolicy policy, int lane, Rng& rng, std::span<double> action) const override;

  /// The true grid, the agent and what it carries.
  const minigrid::State& state(int lane) const { return At(lane).state; }
  /// Starts an episode in `state`, whose grid has the task's size; the clock goes on from state.step_count.
  void SetState(int lane, const minigrid::State& state);
  /// Step of one lane with the moving balls' new places given, one each.
  void StepWithBalls(int lane, minigrid::Action action, std::span<const minigrid::Position> balls);
  /// The density that the next reset of the lane draws with.
  double density(int lane) const { return At(lane).density; }
  /// The share of obstacles among the free cells of the lane's grid (kObstacles alone).
  double realised_density(int lane) const;

 private:
  struct Lane {
    minigrid::State state;
    Rng rng{0};
    double density = 0;
    double reward = 0;
    LaneStatus status = LaneStatus::kRunning;
  };
  Lane& At(int lane) { return lanes_[Checked(lane)]; }
  const Lane& At(int lane) const { return lanes_[Checked(lane)]; }
  size_t Checked(int lane) const {
    OTED_CHECK(lane >= 0 && lane < n_lanes());
    return static_cast<size_t>(lane);
  }
  void StartEpisode(int lane);
  void Finish(int lane, const minigrid::Outcome& outcome);
  void Observe(int lane);

  std::shared_ptr<const MinigridSetup> setup_;
  int n_threads_;
  // A row is one number longer than the observation: room for the encoder's last move.
  Array2<double> observations_;
  std::vector<Lane> lanes_;
};

/// Simulators of one task with one parameter space. The parameter of kObstacles is "env/density": a probability in
/// [0, 1) with scale = "absolute", or a multiple of the task's own density.
class MinigridSimulatorFactory : public SimulatorFactory {
 public:
  /// @throws UsageError for settings or parameters that the task does not take.
  MinigridSimulatorFactory(MinigridTask task, std::vector<ParameterSpec> specs);
  /// The task of that name as it is. @throws UsageError
  MinigridSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }
  std::string why_not_settable() const override { return "an observation does not show the whole of it"; }
  bool has_expert() const override { return true; }
  const MinigridTask& task() const { return setup_->task; }
  /// @throws UsageError unless both numbers are at least 1.
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;
  /// The same, with the grids at hand.
  std::unique_ptr<MinigridSimulator> MakeMinigrid(int n_lanes, int n_threads) const;

 private:
  std::shared_ptr<const MinigridSetup> setup_;
};

}  // namespace oted
