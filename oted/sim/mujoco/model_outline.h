#pragma once
/// What a model has, by name, for those who do not know it: joints, drives, sensors.

#include <limits>
#include <string>
#include <vector>

#include "oted/sim/mujoco/drive_kind.h"

namespace oted {

enum class JointKind { kHinge, kSlide, kBall, kFree };

struct ModelOutline {
  struct Joint {
    std::string name;
    std::string body;                        ///< that it moves
    std::vector<std::string> fastened = {};  ///< bodies with a mass that are fastened to it: a hand, a load
    JointKind kind = JointKind::kHinge;
    bool limited = false;
    double low = 0, high = 0;  ///< [rad, m] where limited
    bool force_limited = false;
    double inertia = 0;     ///< about it in the start state [kg m^2, kg]
    bool actuated = false;  ///< by itself, not through a tendon
    bool has_one_number() const { return kind == JointKind::kHinge || kind == JointKind::kSlide; }
  };
  struct Actuator {
    std::string name;
    int joint = -1;   ///< that it drives; -1: a tendon or something else
    int tendon = -1;  ///< the same
    DriveKind drive = DriveKind::kOther;
    double damping = 0;  ///< -biasprm[2]: of a servo, or a motor's back-EMF
    int n_controls = 1;
    bool has_range = false;
    double force_per_control = 1;                                 ///< on the joint or tendon, of a motor
    double most_force = std::numeric_limits<double>::infinity();  ///< on the joint or tendon
  };
  struct Tendon {
    struct Part {
      int joint = 0;
      double length = 0;  ///< by which it grows per unit of the joint
    };
    std::string name;
    std::vector<Part> joints = {};  ///< of a fixed one; a spatial one has none here
  };
  struct Sensor {
    std::string name;
    int size = 1;
    int joint = -1;         ///< whose one position or velocity it shows; -1: it shows something else
    bool velocity = false;  ///< of that joint
  };
  std::vector<Joint> joints;
  std::vector<Actuator> actuators;
  std::vector<Tendon> tendons;
  std::vector<Sensor> sensors;
  std::vector<std::string> keyframes;
  std::vector<std::string> qpos, qvel;  ///< the paths of every number of the state: "joint/hip/qpos"
  double time_step = 0;                 ///< [s]
  bool has_activations = false;
};

/// @param model  as ModelTask::model. @throws DataError, UsageError as a task of that model would
ModelOutline OutlineOf(const std::string& model);

}  // namespace oted
