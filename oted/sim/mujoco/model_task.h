#pragma once
/// A task that a file describes: a model, what is seen of it, what acts on it, how it starts, what it pays and when it
/// ends. The keys are those of [task] in TOML; docs/task_files.md explains each.

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace oted {

struct ModelTask {
  std::string name;                 ///< what reports call it
  std::string model;                ///< path of an MJCF or URDF file, or "package:dm_control/suite/quadruped.xml"
  std::vector<std::string> motors;  ///< joints that get a motor of their own: "joint/*"
  double control_period = 0;        ///< [s], a multiple of the model's time step
  std::vector<std::string> observations = {"joint/*/qpos", "joint/*/qvel"};
  std::vector<std::string> unobserved;  ///< coordinates that may stay as in the start state: "joint/root/qpos[0]"
  std::vector<std::string> actions = {"actuator/*"};
  std::vector<double> action_range;  ///< [low, high] of controls without a ctrlrange
  std::string start = "default";     ///< "default", "keyframe/NAME" or "logs"
  bool starts_in_logs() const { return start == "logs"; }
  std::vector<double> start_qpos;  ///< (nq) positions of the start state instead of the model's; empty: those
  double start_noise = 0;          ///< half width of uniform noise on qpos and qvel [m, rad, m/s, rad/s]
  std::map<std::string, std::string> quantities;  ///< name in expressions -> path: "height" -> "body/torso/xpos[2]"
  std::string reward;                             ///< per control step; "": none
  std::string terminate;                          ///< not 0: the episode ends; "": never
  int max_episode_steps = 1000;
};

/// Where the model file is. A path that begins with "package:" is of an installed Python package: it is looked up in
/// the folders of the environment variable OTED_PACKAGES (separated by ':'), then in the environment that the program
/// was built with. @throws DataError when there is no such file.
std::filesystem::path FindModelFile(const std::string& model);

/// The files that the model is made of: its own first, then those that it includes, meshes, height fields, skins and
/// textures. @throws as above
std::vector<std::string> ModelFiles(const ModelTask& task);

/// The compiled model, motors included, as a .mjb file has it. @throws as above
std::string CompileToMjb(const ModelTask& task);

}  // namespace oted
