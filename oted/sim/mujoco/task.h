#pragma once
/// Gymnasium's locomotion tasks as data (gymnasium 1.4.0, envs/mujoco/{hopper,half_cheetah,walker2d}_v{4,5}.py), and as
/// D4RL recorded them (-v2: the v4 tasks with the capsules of MuJoCo before 2.1.1).
/// All three observe (qpos without the root's x, qvel) and earn forward speed + healthy bonus - control cost.

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace oted {

/// An open interval (low, high).
struct OpenInterval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  /// False for NaN.
  bool Contains(double value) const { return low < value && value < high; }
};

enum class ResetNoise {
  kUniform,                 ///< U(-scale, scale) on qpos and qvel
  kUniformPositionsNormal,  ///< U(-scale, scale) on qpos, scale N(0, 1) on qvel
};

struct MujocoTask {
  std::string name;      ///< "Hopper-v5"
  std::string xml_file;  ///< within the asset folder
  int frame_skip = 1;    ///< physics steps per control step
  /// Capsules weigh what they did before MuJoCo 2.1.1: the tasks as D4RL recorded them (docs/legacy_engine.md).
  bool legacy_capsules = false;

  double velocity_clip = std::numeric_limits<double>::infinity();  ///< observed velocities are clamped to +-this

  double forward_weight = 1;        ///< of the root's speed along x [s/m]
  double healthy_reward = 0;        ///< per step
  bool healthy_on_terminal = true;  ///< v2 and v4 pay the bonus on the terminal step too
  double control_cost_weight = 0;   ///< of the sum of squared actions, as given (MuJoCo clamps them, the cost does not)

  bool terminates = false;         ///< when one of the ranges below is left
  OpenInterval healthy_height;     ///< of qpos[1] [m]
  OpenInterval healthy_angle;      ///< of qpos[2] [rad]
  OpenInterval healthy_remainder;  ///< of every number of (qpos, qvel) from index 2 on

  ResetNoise reset_noise = ResetNoise::kUniform;
  double reset_noise_scale = 0;

  int max_episode_steps = 1000;
  double return_random = 0;  ///< D4RL's reference returns (d4rl/infos.py, REF_MIN_SCORE and REF_MAX_SCORE)
  double return_expert = 0;
};

/// The task of that name. @throws UsageError with the nearest name and the list.
const MujocoTask& FindTask(const std::string& name);

/// "Hopper-v2", "Hopper-v4", "Hopper-v5", "HalfCheetah-v2", ...
std::vector<std::string> TaskNames();

/// Where the tasks' model files are: the environment variable OTED_ASSETS, else the folder known at build time.
std::filesystem::path AssetFolder();

}  // namespace oted
