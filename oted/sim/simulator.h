#pragma once
/// The tunable simulator M(z) of the paper (Sec. 3), vectorised: N lanes, each with its own parameters z.
/// Hopper and MiniGrid are implementations; a user's own class is another. It takes actions and knows no network.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/turning_body.h"
#include "oted/sim/parameter_info.h"
#include "oted/sim/parameter_space.h"
#include "oted/sim/renderer.h"

namespace oted {

/// One number of the state that no observation shows, and what logs tell of it.
struct HiddenCoordinate {
  std::string name;     ///< "joint/hip/qvel"
  int rate_of = -1;     ///< the observation whose rate of change it is [1/s]; -1: none
  int turn_about = -1;  ///< 0, 1, 2: the angular velocity of a body about that axis of its own; -1: none
  std::array<int, 4> orientation = {};  ///< the observations of that body's quaternion (w, x, y, z)
};

/// Shapes and units of a simulator, the same for all its lanes.
struct SimulatorSpec {
  std::string task;                    ///< "Hopper-v5"
  std::vector<int> observation_shape;  ///< {11}, or {7, 7, 3} for an image; lanes hold it flattened, row-major
  std::vector<int> image_shape;        ///< {7, 7, 3}: the observation's leading part is an image; else empty
  /// Per number of the observation: n where it is an index 0, ..., n - 1 (the kind of a cell), 0 where it is a
  /// quantity. Empty: quantities all.
  std::vector<int> observation_levels;
  std::vector<std::string> observation_names;  ///< one per number for flat observations; may be empty for images
  std::vector<std::string> observation_units;  ///< parallel to the names; empty where unknown
  int act_dim = 0;                             ///< length of a continuous action; 1 for discrete ones
  std::vector<std::string> action_names;       ///< one per number of an action; may be empty
  int n_discrete_actions = 0;                  ///< 0: continuous in [action_low, action_high]
  std::vector<double> action_low;
  std::vector<double> action_high;
  /// (act_dim): whether the simulator itself holds an action within that range; empty: each.
  std::vector<char> bounds_action = {};
  double control_period_s = 0;  ///< time between two actions [s]; 0 where time has no unit
  int physics_steps = 1;        ///< of the simulator between two actions
  double step_weight = 1;      ///< what one of them costs beside those of small robots: what takes long uses fewer rows
  int max_episode_steps = 0;   ///< truncation by the clock; 0: none
  bool can_set_state = false;  ///< SetStateFromObservation works
  /// What a state is beside an observation: with these numbers SetState works where can_set_state is false. Empty where
  /// an observation is enough, and where too much is missing.
  std::vector<HiddenCoordinate> hidden;
  /// (obs_dim): the observation of which each is the rate of change [1/s], -1 for none; empty where nothing is known.
  std::vector<int> rate_of;
  std::vector<TurningBody> bodies;  ///< that turn in space, where an observation shows any of them
  /// (obs_dim): for how many control steps after SetState a reading may be older than that state; empty: for none.
  std::vector<int> reading_ages;
  std::vector<std::string> constant_names;  ///< one per number of LoggedHistory::constants
  bool has_reward = true;                   ///< false: reward() is always 0, and no agent can be trained
  int n_past_actions = 0;  ///< earlier actions that, beside the present one, the next observation may depend on
  /// Logged rows before a start until which the commands say where a filtered drive is, to a hundredth of its way.
  int n_rows_before = 0;
  double return_random = 0;  ///< D4RL's reference returns; the normalised score is
  double return_expert = 0;  ///< 100 (return - random) / (expert - random); equal: no score

  int obs_dim() const;
  /// Whether logged windows can be replayed, from states that a fit finds.
  bool can_replay() const { return can_set_state || !hidden.empty(); }
  int state_dim() const { return obs_dim() + static_cast<int>(hidden.size()); }
  /// Component k of what acts on average where action `before` holds for `share` of a while and `now` for the rest:
  /// each is bounded before they mix.
  double MeanAction(size_t k, double before, double now, double share) const;
  bool has_score() const { return return_expert != return_random; }
  /// D4RL's normalised score of an undiscounted return.
  double NormalizedScore(double episode_return) const;
};

/// What became of a lane in its last step.
enum class LaneStatus : uint8_t {
  kRunning,
  kTerminated,  ///< the task's own end: no value beyond it
  kTruncated,   ///< the time limit: the state has a value, bootstrap through it
  kDiverged,    ///< the physics broke down: the step's numbers mean nothing, drop them
};

/// What was logged in the same episode before a state, oldest row first; empty where the episode begins there.
struct LoggedHistory {
  std::span<const double> observations;  ///< (n, obs_dim)
  std::span<const double> actions;       ///< (n, act_dim): row k was given at observation k
  /// What is known of the recording, as a Dataset's constants; empty: it is as the model.
  std::span<const double> constants = {};
};

/// What lanes are held at until their present action arrives. Rows of lanes that are not stepped are not read.
struct LateActions {
  std::span<const double> before;  ///< (n_lanes, act_dim)
  std::span<const double> share;   ///< (n_lanes, act_dim): of the control period, 0 <= share < 1
};

/// A policy that a task brings along. It acts on a lane's true state, which no observation need show.
enum class TaskPolicy {
  kExpert,  ///< the best that can be done
  kMedium,  ///< the expert with mistakes
};

/// N lanes. Not thread-safe; one object may use several threads inside, with equal bytes at any number of them.
/// A lane starts undefined: Reset or SetStateFromObservation it before its first Step.
class Simulator {
 public:
  virtual ~Simulator() = default;

  virtual const SimulatorSpec& spec() const = 0;
  virtual const ParameterSpace& parameters() const = 0;
  virtual int n_lanes() const = 0;

  /// Sets the parameters of one lane; always applied to the pristine model. Takes effect at the lane's next step, or at
  /// its next reset for what acts there. @throws UsageError when z is outside its bounds.
  virtual void SetParameters(int lane, std::span<const double> z) = 0;

  /// Draws a new start state of one lane: rho_0(. | z).
  virtual void Reset(int lane, Rng& rng) = 0;

  /// The same at a start of the caller's: generalised positions [m, rad] and velocities [m/s, rad/s]; everything else
  /// as in the task's start state. @throws UsageError for wrong lengths, or where the simulator has no such state.
  virtual void ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng);

  /// Puts one lane into the state that shows `observation`; its episode clock starts at zero. False when the
  /// observation does not determine a state (a clipped velocity): the lane is then unchanged.
  /// @throws UsageError when spec().can_set_state is false.
  virtual bool SetStateFromObservation(int lane, std::span<const double> observation) = 0;

  /// The same where it is known what was logged before: a simulator with delays or filtered drives reaches back into
  /// it. Without them the observation is enough.
  virtual bool SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) {
    static_cast<void>(before);
    return SetStateFromObservation(lane, observation);
  }

  /// Puts one lane into a state that no log need have shown: what its sensors would read there without noise and delay
  /// (obs_dim numbers), then spec().hidden. The actions in `before` fill what an action delay has yet to deliver, and
  /// drive what follows them alone; a
  /// sensor with a delay shows the state itself until it has seen what comes after it. False as
  /// SetStateFromObservation. @throws UsageError unless spec().can_replay().
  virtual bool SetState(int lane, std::span<const double> state, const LoggedHistory& before) {
    return SetStateFromLog(lane, state, before);
  }

  /// Whether the task ends in the state that shows `observation`, by its own rule and not by the clock; nothing where
  /// the observation does not determine that or the simulator cannot say. Puts the lane into that state.
  virtual std::optional<bool> EndsAt(int lane, std::span<const double> observation) {
    (void)lane, (void)observation;
    return std::nullopt;
  }

  /// One control period for the lanes listed in `lanes`. `actions` is (n_lanes, act_dim); rows of other lanes are not
  /// read. A lane that has ended is not reset by itself.
  virtual void Step(std::span<const int> lanes, std::span<const double> actions) = 0;

  /// The same with commands that arrive within the period: each is `late.before` for the first `late.share` of it, and
  /// that of `actions` from then on. A simulator that knows no shorter time takes the mean of the two over the period,
  /// each within its bounds.
  virtual void StepLate(std::span<const int> lanes, std::span<const double> actions, const LateActions& late);

  /// Of one lane, after its last Reset, SetStateFromObservation or Step.
  virtual std::span<const double> observation(int lane) const = 0;
  virtual double reward(int lane) const = 0;
  virtual LaneStatus status(int lane) const = 0;

  /// Where the parts of one lane are, for a Renderer of its factory: generalised positions [m, rad]. Empty where
  /// nothing can be drawn.
  virtual std::span<const double> pose(int lane) const {
    (void)lane;
    return {};
  }
  /// How fast each number of the lane's pose changes [m/s, rad/s]; 0 for one that has no velocity of its own, such as
  /// those of a quaternion.
  virtual std::vector<double> pose_rates(int lane) const { return std::vector<double>(pose(lane).size(), 0.0); }
  /// Writes the action (act_dim) that a policy of the task takes in the lane's true state. `rng` is the policy's own.
  /// @throws UsageError unless the factory's has_expert().
  virtual void TakeTaskPolicy(TaskPolicy policy, int lane, Rng& rng, std::span<double> action) const;
};

/// Makes simulators of one task that differ in their number of lanes and threads only. Thread-safe.
class SimulatorFactory {
 public:
  virtual ~SimulatorFactory() = default;
  virtual const SimulatorSpec& spec() const = 0;
  virtual const ParameterSpace& parameters() const = 0;
  virtual std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const = 0;

  /// Everything that a path can name, for those who look for parameters; empty where the simulator declares its own.
  virtual std::vector<ParameterOffer> Offers() const { return {}; }
  /// What one path stands for. @throws UsageError when it names nothing.
  virtual PathInfo Describe(const std::string& path) const;
  /// What else is often off in such a simulator: parameters that touch nothing that its own ones do, or multiply a part
  /// of what one of them gives. None where it does not know.
  virtual std::vector<ParameterSpec> Suspects() const { return {}; }
  /// Of one of Suspects, each joint, drive, tendon or body alone, where it is of several. Others may have the same
  /// names.
  virtual std::vector<ParameterSpec> PartsOf(const ParameterSpec& /*suspect*/) const { return {}; }
  /// The same simulator with further parameters after its own; null where it cannot have any.
  virtual std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& /*more*/) const { return nullptr; }
  /// The SHA-256 of the model file that is simulated, or another text that changes when the simulated thing does: what
  /// was computed with another one is not used again. "" where the task's name says it all.
  virtual std::string model_sha256() const { return ""; }
  /// Why a lane cannot be set to an observed state, for a sentence's end; "" where it can or no reason is known.
  virtual std::string why_not_settable() const { return ""; }
  /// Whether the task brings its own policies along: Simulator::TakeTaskPolicy.
  virtual bool has_expert() const { return false; }
  /// Draws poses of this task's simulators.
  /// @param width, height  of the pictures [pixels], multiples of 4
  /// @return null where nothing can be drawn; `why_not` says why in one line
  virtual std::unique_ptr<Renderer> MakeRenderer(int width, int height, std::string* why_not) const;

  /// Names of the parameters that an MJCF file of the simulated model cannot hold, such as a sensor's delay. None where
  /// no model is simulated that MJCF could hold.
  virtual std::optional<std::vector<std::string>> NotInMjcf() const { return std::nullopt; }
  /// Whether such a file can make actions act later without another change: MuJoCo fills the past of a late
  /// actuator with the command 0, at which motors rest, but a servo runs to its zero.
  virtual bool mjcf_delays_actions() const { return false; }
  /// The model simulated at z as MJCF text, with `comment` at its top; without what NotInMjcf names.
  /// @param action_delays_s  (act_dim) or empty: how much later each action acts [s], if mjcf_delays_actions()
  /// @throws UsageError where there is none, or z is outside its bounds; DataError where MuJoCo cannot write the values
  /// exactly
  virtual std::string Mjcf(std::span<const double> z, const std::string& comment,
                           std::span<const double> action_delays_s = {}) const;
};

}  // namespace oted
