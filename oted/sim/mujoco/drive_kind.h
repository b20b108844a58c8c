#pragma once
/// What a control of an actuator is, by the numbers that MuJoCo's compiler gives it.

struct mjModel_;

namespace oted {

/// A force, a position or a velocity to be reached, or something else.
enum class DriveKind { kMotor, kPositionServo, kVelocityServo, kOther };

/// A servo's feedback is as strong as its gain: -biasprm[1] of a position servo, -biasprm[2] of a velocity servo. A
/// motor has no feedback, or that of its velocity alone (its back-EMF).
DriveKind DriveOf(const mjModel_& model, int actuator);

/// -biasprm[2] of a servo or a motor, thus what acts like a damping of what it drives; 0 of anything else.
double DampingOfDrive(const mjModel_& model, int actuator);

}  // namespace oted
