#pragma once
/// Tasks on MuJoCo's batch API: N lanes of one model, each with its own values of the model's fields. Equal bytes at
/// any number of threads. What a task shows and pays is a TaskRules: Gymnasium's three, or a task file's.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/mujoco/task_rules.h"
#include "oted/sim/mujoco/unit_vectors.h"
#include "oted/sim/simulator.h"

struct mjBatch_;
struct mjModel_;

namespace oted {

class JointFriction;
class JointResidual;

/// What the simulators of one factory share, read-only.
struct MujocoSetup;

/// Physics, observation, reward, termination and truncation of one task.
///
/// A lane that diverged (MuJoCo reports a bad qpos, qvel or qacc, or a number of its state or observation is not
/// finite) keeps the observation before the step, earns 0, and stays kDiverged, not simulated, until it is reset. A
/// step past termination goes on simulating and reports termination again.
class MujocoSimulator : public Simulator {
 public:
  MujocoSimulator(std::shared_ptr<const MujocoSetup> setup, int n_lanes, int n_threads);
  ~MujocoSimulator() override;

  const SimulatorSpec& spec() const override;
  const ParameterSpace& parameters() const override;
  int n_lanes() const override { return observations_.rows(); }

  void SetParameters(int lane, std::span<const double> z) override;
  void Reset(int lane, Rng& rng) override;
  void ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng) override;
  /// What no observation shows is as in the start state. The lane shows `observation` itself. False when it does not
  /// determine a state: a velocity on Gymnasium's clip, a quaternion of zeros, a number that is not finite.
  /// @throws UsageError when the length is not obs_dim, or spec().can_set_state is false.
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  /// Activations that follow the commands are where the actions before have led them.
  bool SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) override;
  bool SetState(int lane, std::span<const double> state, const LoggedHistory& before) override;
  /// Nothing when a velocity lies on the clip.
  std::optional<bool> EndsAt(int lane, std::span<const double> observation) override;
  /// @throws UsageError when an action is not finite; nothing is simulated then. DataError when a task file's
  /// expression gives no finite number.
  void Step(std::span<const int> lanes, std::span<const double> actions) override;
  /// The commands change between two time steps of the physics; in the one that a change falls into, the controls are
  /// the mean over it. So do MuJoCo's own actuators that have a delay. The reward is that of the period's mean.
  void StepLate(std::span<const int> lanes, std::span<const double> actions, const LateActions& late) override;

  std::span<const double> observation(int lane) const override { return observations_.row(lane); }
  double reward(int lane) const override { return lanes_[static_cast<size_t>(lane)].reward; }
  LaneStatus status(int lane) const override { return lanes_[static_cast<size_t>(lane)].status; }

  std::span<const double> pose(int lane) const override { return qpos(lane); }
  std::vector<double> pose_rates(int lane) const override;

  /// The lane's whole state, as mj_getState(mjSTATE_INTEGRATION) gives it: positions, velocities, warm start, controls.
  std::span<const double> IntegrationState(int lane) const;
  /// Restores it; the episode clock starts at zero. @throws UsageError when the length is wrong.
  void SetIntegrationState(int lane, std::span<const double> state);

  /// Writes the model that the lane simulates, its parameters applied as far as a model has them, into a copy of the
  /// factory's model().
  void CopyModel(int lane, mjModel_& model) const;

  std::span<const double> qpos(int lane) const;  ///< generalised positions (nq) [m, rad]
  std::span<const double> qvel(int lane) const;  ///< generalised velocities (nv) [m/s, rad/s]
  const TaskRules& rules() const { return *rules_; }
  /// MuJoCo's own object, for what draws the lanes.
  mjBatch_* batch() const { return batch_.get(); }
  int episode_steps(int lane) const { return lanes_[static_cast<size_t>(lane)].episode_steps; }

 private:
  struct Lane {
    double reward = 0;
    LaneStatus status = LaneStatus::kRunning;
    int episode_steps = 0;
  };
  struct BatchDeleter {
    BatchDeleter() : threads_of(0) {}
    explicit BatchDeleter(int process) : threads_of(process) {}
    int threads_of;  // the process that has the batch's threads; 0: it has none
    /// Whether they stayed behind when this process was forked.
    bool HasLostThreads() const;
    void operator()(mjBatch_* batch) const;
  };
  // One model field with values per lane.
  struct ExpandedField {
    double* values = nullptr;
    int size = 0;
  };

  ExpandedField Expand(const std::string& array);
  void UpdateBoundingRadii(int lane, const double* sizes);
  LaneArray StateComponent(int component);
  LaneArray ArrayNamed(const std::string& name);
  LaneState StateOf(int lane) const;
  void StartEpisode(int lane);
  bool SetTo(int lane, std::span<const double> observation, std::span<const double> hidden,
             const LoggedHistory& before);
  void FollowCommands(int lane, std::span<const double> actions);
  /// Makes `lanes` the active ones, but for those that diverged.
  void Activate(std::span<const int> lanes, std::span<const double> actions);
  void SetControls(int lane, std::span<const double> action);
  /// @throws UsageError in a forked process, where the batch's threads are not
  void CheckThreads() const;
  /// `n_steps` time steps of the active lanes, the last of a control period or not. @return as mjb_step
  int StepPhysics(int n_steps, bool is_last);
  /// Throws if StepPhysics failed anywhere.
  void CheckPhysics(int n_failed) const;
  void FinishStep(int lane, std::span<const double> action);
  bool TakeDivergence(int lane);

  std::shared_ptr<const MujocoSetup> setup_;
  std::unique_ptr<mjBatch_, BatchDeleter> batch_;
  int n_state_ = 0;
  LaneArray state_, qpos_, qvel_, act_, ctrl_;
  std::unique_ptr<TaskRules> rules_;
  std::unique_ptr<JointFriction> friction_;  // where parameters of it are searched; likewise the next
  std::unique_ptr<JointResidual> residual_;
  std::vector<LaneArray> arrays_;      // parallel to rules_->arrays()
  std::vector<ExpandedField> fields_;  // parallel to the parameters
  UnitVectors unit_vectors_;           // of those
  ExpandedField bounding_radii_;       // used when a parameter changes the size of a geom
  ExpandedField dynprm_;               // likewise the time constant of a drive
  bool changes_constants_ = false;
  std::vector<std::vector<double>> parameters_;  // of each lane, as its model has them; empty where not set yet
  Array2<double> observations_;
  Array2<double> memory_;            // of the rules, per lane
  std::vector<double> observation_;  // of the lane at hand
  std::vector<Lane> lanes_;
  std::vector<int> active_;
};

}  // namespace oted
