#pragma once
/// Dry friction of joints beyond MuJoCo's frictionloss, which has one value at any speed and load:
///
///   frictionloss + stribeck_torque exp(-(v / stribeck_velocity)^2) + load_friction |f|
///
/// v is the joint's velocity and f the force that its actuators exert on it. The sum takes frictionloss's place in
/// MuJoCo's solver at the start of every physics step: sticking is the solver's, and no state is added.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"

struct mjBatch_;
struct mjModel_;
struct mjData_;

namespace oted {

/// An array that MuJoCo's model lacks, with one number for each degree of freedom.
struct FrictionArray {
  const char* name;  ///< as mjModel would call it: "dof_stribeck_torque"
  double nominal;    ///< of every joint of every model
};
enum FrictionQuantity { kStribeckTorque, kStribeckVelocity, kLoadFriction, kFrictionQuantities };
/// By FrictionQuantity.
inline constexpr std::array<FrictionArray, kFrictionQuantities> kFrictionArrays = {
    {{"dof_stribeck_torque", 0.0}, {"dof_stribeck_velocity", 0.1}, {"dof_load_friction", 0.0}}};

/// Whether an array is one of them.
bool IsFrictionArray(const std::string& array);
/// Whether a path, or one of those that are tied together in it, is this array's field of a joint: "dof_residual" of
/// joint/NAME/residual[2].
bool ReachesJointArray(const std::string& path, const std::string& array);
/// Whether a path, or one of those that are tied together in it, is a joint's stribeck_torque, stribeck_velocity or
/// load_friction: MJCF has no place for it.
bool IsFrictionPath(const std::string& path);

/// The friction of all lanes of a batch.
class JointFriction {
 public:
  /// @param loaded  whether load_friction is a parameter: lanes that have some take another pass over each physics step
  JointFriction(mjBatch_* batch, bool loaded);

  /// (lanes, nv) of dof_frictionloss or a FrictionArray: where parameters are written.
  double* Values(const std::string& array);
  /// Of one lane, (nv): dof_frictionloss as the parameters have it.
  std::span<const double> Base(int lane) const { return base_.row(lane); }
  /// Writes what the batch takes for frictionloss where the lane's actuators rest.
  void Rest(int lane);
  /// Before a physics step: writes the friction that these lanes have in it. @return as mjb_apply
  int Prepare(std::span<const int> lanes);

 private:
  static void TakeLoad(const mjModel_* model, mjData_* data, int lane, void* self);
  bool GrowsWithLoad(int lane) const;
  void Write(int lane);

  mjBatch_* batch_;
  bool loaded_;
  int nv_;
  double* frictionloss_;      // the batch's, (lanes, nv)
  const double* velocities_;  // of the first lane; those of the next lie a state further
  int n_state_;
  Array2<double> base_, load_;
  std::array<Array2<double>, kFrictionQuantities> values_;
};

}  // namespace oted
