#include "oted/sim/mujoco/drive_kind.h"

#include <mujoco/mujoco.h>

namespace oted {

DriveKind DriveOf(const mjModel& model, int actuator) {
  const double gain = model.actuator_gainprm[actuator * mjNGAIN];
  const double* bias = model.actuator_biasprm + actuator * mjNBIAS;
  if (model.actuator_gaintype[actuator] != mjGAIN_FIXED) return DriveKind::kOther;
  if (model.actuator_biastype[actuator] == mjBIAS_NONE) return DriveKind::kMotor;
  if (model.actuator_biastype[actuator] != mjBIAS_AFFINE) return DriveKind::kOther;
  if (bias[1] == 0 && bias[2] == 0) return DriveKind::kMotor;
  if (gain == 0) return DriveKind::kOther;
  if (bias[1] == -gain) return DriveKind::kPositionServo;
  if (bias[1] != 0) return DriveKind::kOther;
  return bias[2] == -gain ? DriveKind::kVelocityServo : DriveKind::kMotor;
}

double DampingOfDrive(const mjModel& model, int actuator) {
  const bool is_affine = model.actuator_biastype[actuator] == mjBIAS_AFFINE;
  if (!is_affine || DriveOf(model, actuator) == DriveKind::kOther) return 0;
  return -model.actuator_biasprm[actuator * mjNBIAS + 2];
}

}  // namespace oted
