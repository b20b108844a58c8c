#pragma once
/// Hopper, HalfCheetah and Walker2d as Gymnasium defines them, on MuJoCo's batch API: N lanes of one model, each with
/// its own values of the model's fields. Equal bytes at any number of threads.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/simulator.h"

struct mjBatch_;

namespace oted {

struct MujocoTask;

/// What the simulators of one factory share, read-only.
struct MujocoSetup;

/// Physics, observation, reward, termination and truncation of one task.
///
/// A lane that diverged (MuJoCo reports a bad qpos, qvel or qacc, or a number of its state is not finite) keeps the
/// observation before the step, earns 0, and stays kDiverged, not simulated, until it is reset.
/// A step past termination goes on simulating and reports termination again.
class MujocoSimulator : public Simulator {
 public:
  MujocoSimulator(std::shared_ptr<const MujocoSetup> setup, int n_lanes, int n_threads);
  ~MujocoSimulator() override;

  const SimulatorSpec& spec() const override;
  const ParameterSpace& parameters() const override;
  int n_lanes() const override { return observations_.rows(); }

  void SetParameters(int lane, std::span<const double> z) override;
  void Reset(int lane, Rng& rng) override;
  /// The root's x, which no observation shows, becomes 0. False when a velocity lies on the clip (|v| >= 10 where the
  /// task clips) or a number is not finite. @throws UsageError when the length is not obs_dim.
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  /// @throws UsageError when an action is not finite; nothing is simulated then.
  void Step(std::span<const int> lanes, std::span<const double> actions) override;

  std::span<const double> observation(int lane) const override { return observations_.row(lane); }
  double reward(int lane) const override { return lanes_[static_cast<size_t>(lane)].reward; }
  LaneStatus status(int lane) const override { return lanes_[static_cast<size_t>(lane)].status; }

  /// The lane's whole state, as mj_getState(mjSTATE_INTEGRATION) gives it: positions, velocities, warm start, controls.
  std::span<const double> IntegrationState(int lane) const;
  /// Restores it; the episode clock starts at zero. @throws UsageError when the length is wrong.
  void SetIntegrationState(int lane, std::span<const double> state);

  std::span<const double> qpos(int lane) const;  ///< generalised positions (nq) [m, rad]
  std::span<const double> qvel(int lane) const;  ///< generalised velocities (nv) [m/s, rad/s]
  /// MuJoCo's own object, for what draws the lanes.
  mjBatch_* batch() const { return batch_.get(); }
  int episode_steps(int lane) const { return lanes_[static_cast<size_t>(lane)].episode_steps; }

 private:
  struct Lane {
    double x_before = 0;
    double reward = 0;
    LaneStatus status = LaneStatus::kRunning;
    int episode_steps = 0;
  };
  struct BatchDeleter {
    void operator()(mjBatch_* batch) const;
  };
  // One component of every state row.
  struct Component {
    double* first = nullptr;
    int size = 0;
  };
  // One model field with values per lane.
  struct ExpandedField {
    double* values = nullptr;
    int size = 0;
  };

  ExpandedField Expand(const std::string& array);
  void UpdateBoundingRadii(int lane, const double* sizes);
  Component StateComponent(int component);
  std::span<double> Row(const Component& component, int lane) const;
  void StartEpisode(int lane);
  void FinishStep(int lane, std::span<const double> action);
  void Observe(int lane);
  bool TakeDivergence(int lane);

  std::shared_ptr<const MujocoSetup> setup_;
  std::unique_ptr<mjBatch_, BatchDeleter> batch_;
  int n_state_ = 0;
  Component state_, qpos_, qvel_, ctrl_;
  std::vector<ExpandedField> fields_;  // parallel to the parameters
  ExpandedField bounding_radii_;       // used when a parameter changes the size of a geom
  bool changes_constants_ = false;
  Array2<double> observations_;
  std::vector<Lane> lanes_;
  std::vector<int> active_;
};

/// Simulators of one task with one parameter space. The model is loaded and every parameter resolved here, so that a
/// mistake shows before any work starts.
class MujocoSimulatorFactory : public SimulatorFactory {
 public:
  /// @throws UsageError for an unknown task or a parameter that the model does not have; DataError for a model file
  /// that is missing or does not compile.
  MujocoSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs);
  ~MujocoSimulatorFactory() override;

  const SimulatorSpec& spec() const override;
  const ParameterSpace& parameters() const override;
  /// @throws UsageError unless both numbers are at least 1.
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override;
  /// The same, with MuJoCo's own state at hand.
  std::unique_ptr<MujocoSimulator> MakeMujoco(int n_lanes, int n_threads) const;

  const MujocoTask& task() const;
  std::string model_path() const;    ///< the MJCF file that was loaded
  std::string model_sha256() const;  ///< of the compiled pristine model

 private:
  std::shared_ptr<const MujocoSetup> setup_;
};

}  // namespace oted
