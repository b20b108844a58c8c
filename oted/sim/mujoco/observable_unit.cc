#include "oted/sim/mujoco/observable_unit.h"

#include <map>

namespace oted {
namespace {

// A place, a velocity, an acceleration, a force: of what slides, and of what turns.
struct Units {
  const char* sliding;
  const char* turning;

  std::string Of(bool slides) const { return slides ? sliding : turning; }
};

constexpr Units kPlace = {"m", "rad"}, kVelocity = {"m/s", "rad/s"}, kAcceleration = {"m/s^2", "rad/s^2"},
                kForce = {"N", "N m"};

// The last of the objects whose numbers begin at or before `index`.
int OwnerOf(const int* addresses, int count, int index) {
  int owner = 0;
  while (owner + 1 < count && addresses[owner + 1] <= index) ++owner;
  return owner;
}

// Whether a degree of freedom of a joint slides: the first three of a free one do.
bool Slides(const mjModel& m, int joint, int dof_of_joint) {
  const int type = m.jnt_type[joint];
  return type == mjJNT_SLIDE || (type == mjJNT_FREE && dof_of_joint < 3);
}

std::string OfPosition(const mjModel& m, int index) {
  const int joint = OwnerOf(m.jnt_qposadr, static_cast<int>(m.njnt), index);
  const int number = index - m.jnt_qposadr[joint], type = m.jnt_type[joint];
  const bool is_quaternion = type == mjJNT_BALL || (type == mjJNT_FREE && number >= 3);
  return is_quaternion ? "" : kPlace.Of(Slides(m, joint, number));
}

std::string OfDof(const mjModel& m, int dof, const Units& units) {
  const int joint = m.dof_jntid[dof];
  return units.Of(Slides(m, joint, dof - m.jnt_dofadr[joint]));
}

// Joints in a fixed tendon may have different units.
bool IsSpatial(const mjModel& m, int tendon) { return m.wrap_type[m.tendon_adr[tendon]] != mjWRAP_JOINT; }

std::string OfActuator(const mjModel& m, int output, const Units& units) {
  const int actuator = OwnerOf(m.actuator_outadr, static_cast<int>(m.nactuator), output);
  const int what = m.actuator_trnid[2 * actuator];
  switch (m.actuator_trntype[actuator]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT:
      if (m.jnt_type[what] == mjJNT_HINGE || m.jnt_type[what] == mjJNT_SLIDE) return units.Of(Slides(m, what, 0));
      return "";
    case mjTRN_TENDON:
      return IsSpatial(m, what) ? units.sliding : "";
    default:
      return "";
  }
}

std::string OfSensor(const mjModel& m, int index) {
  const int sensor = OwnerOf(m.sensor_adr, static_cast<int>(m.nsensor), index), object = m.sensor_objid[sensor];
  static const std::map<int, const char*> known = {{mjSENS_TOUCH, "N"},
                                                   {mjSENS_ACCELEROMETER, "m/s^2"},
                                                   {mjSENS_VELOCIMETER, "m/s"},
                                                   {mjSENS_GYRO, "rad/s"},
                                                   {mjSENS_FORCE, "N"},
                                                   {mjSENS_TORQUE, "N m"},
                                                   {mjSENS_RANGEFINDER, "m"},
                                                   {mjSENS_BALLANGVEL, "rad/s"},
                                                   {mjSENS_FRAMEPOS, "m"},
                                                   {mjSENS_FRAMELINVEL, "m/s"},
                                                   {mjSENS_FRAMEANGVEL, "rad/s"},
                                                   {mjSENS_FRAMELINACC, "m/s^2"},
                                                   {mjSENS_FRAMEANGACC, "rad/s^2"},
                                                   {mjSENS_SUBTREECOM, "m"},
                                                   {mjSENS_SUBTREELINVEL, "m/s"},
                                                   {mjSENS_CLOCK, "s"}};
  switch (m.sensor_type[sensor]) {
    case mjSENS_JOINTPOS:
      return kPlace.Of(Slides(m, object, 0));
    case mjSENS_JOINTVEL:
      return kVelocity.Of(Slides(m, object, 0));
    case mjSENS_JOINTACTFRC:
      return kForce.Of(Slides(m, object, 0));
    case mjSENS_TENDONPOS:
      return IsSpatial(m, object) ? kPlace.sliding : "";
    case mjSENS_TENDONVEL:
      return IsSpatial(m, object) ? kVelocity.sliding : "";
    case mjSENS_ACTUATORPOS:
      return OfActuator(m, m.actuator_outadr[object], kPlace);
    case mjSENS_ACTUATORVEL:
      return OfActuator(m, m.actuator_outadr[object], kVelocity);
    case mjSENS_ACTUATORFRC:
      return OfActuator(m, m.actuator_outadr[object], kForce);
    default: {
      const auto unit = known.find(m.sensor_type[sensor]);
      return unit == known.end() ? "" : unit->second;
    }
  }
}

}  // namespace

std::string UnitOf(const mjModel& model, const Observable& observable) {
  const std::string& array = observable.array;
  const int index = observable.index;
  if (array == "qpos") return OfPosition(model, index);
  if (array == "qvel") return OfDof(model, index, kVelocity);
  if (array == "qacc") return OfDof(model, index, kAcceleration);
  if (array == "qfrc_actuator") return OfDof(model, index, kForce);
  if (array == "sensordata") return OfSensor(model, index);
  if (array == "actuator_length") return OfActuator(model, index, kPlace);
  if (array == "actuator_velocity") return OfActuator(model, index, kVelocity);
  if (array == "actuator_force") return OfActuator(model, index, kForce);
  if (array == "ten_length") return IsSpatial(model, index) ? kPlace.sliding : "";
  if (array == "ten_velocity") return IsSpatial(model, index) ? kVelocity.sliding : "";
  if (array == "xpos" || array == "subtree_com" || array == "site_xpos" || array == "geom_xpos") return kPlace.sliding;
  return "";
}

}  // namespace oted
