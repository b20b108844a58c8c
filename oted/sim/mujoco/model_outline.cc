#include "oted/sim/mujoco/model_outline.h"

#include <mujoco/mujoco.h>

#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_probe.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_errors.h"
#include "oted/sim/mujoco/object_path.h"
#include "oted/sim/mujoco/observables.h"
#include "oted/sim/mujoco/tendon_joints.h"

namespace oted {
namespace {

JointKind KindOfJoint(int type) {
  switch (type) {
    case mjJNT_FREE:
      return JointKind::kFree;
    case mjJNT_BALL:
      return JointKind::kBall;
    case mjJNT_SLIDE:
      return JointKind::kSlide;
    default:
      return JointKind::kHinge;
  }
}

ModelOutline::Actuator OutlineOfActuator(const mjModel& model, int id) {
  ModelOutline::Actuator actuator;
  actuator.name = ObjectName(model, mjOBJ_ACTUATOR, id);
  const int type = model.actuator_trntype[id];
  if (type == mjTRN_JOINT || type == mjTRN_JOINTINPARENT) actuator.joint = model.actuator_trnid[2 * id];
  if (type == mjTRN_TENDON) actuator.tendon = model.actuator_trnid[2 * id];
  actuator.drive = DriveOf(model, id);
  actuator.damping = DampingOfDrive(model, id);
  actuator.n_controls = model.actuator_ctrlnum[id];
  const double gear = std::abs(model.actuator_gear[6 * model.actuator_outadr[id]]);
  actuator.force_per_control = gear * std::abs(model.actuator_gainprm[id * mjNGAIN]);
  actuator.has_range = true;
  for (int k = 0; k < actuator.n_controls; ++k) {
    actuator.has_range = actuator.has_range && model.actuator_ctrllimited[model.actuator_ctrladr[id] + k] != 0;
  }
  if (model.actuator_forcelimited[id] != 0) actuator.most_force = gear * model.actuator_forcerange[2 * id + 1];
  return actuator;
}

ModelOutline::Tendon OutlineOfTendon(const mjModel& model, int id) {
  ModelOutline::Tendon tendon{ObjectName(model, mjOBJ_TENDON, id)};
  for (const TendonJoint& joint : JointsOfTendon(model, id)) tendon.joints.push_back({joint.id, joint.coefficient});
  return tendon;
}

}  // namespace

ModelOutline OutlineOf(const std::string& model_file) {
  TakeOverMujocoErrors();
  const std::filesystem::path path = FindModelFile(model_file);
  ProbeModel(path);
  const LoadedModel loaded = LoadModel(path);
  const mjModel& model = *loaded.model;
  ModelOutline outline;
  outline.time_step = model.opt.timestep;
  outline.has_activations = model.na > 0;
  for (int i = 0; i < model.njnt; ++i) {
    ModelOutline::Joint joint;
    joint.name = ObjectName(model, mjOBJ_JOINT, i);
    joint.body = ObjectName(model, mjOBJ_BODY, model.jnt_bodyid[i]);
    for (int body = model.jnt_bodyid[i] + 1; body < model.nbody; ++body) {
      if (model.body_weldid[body] == model.jnt_bodyid[i] && model.body_mass[body] > 0) {
        joint.fastened.push_back(ObjectName(model, mjOBJ_BODY, body));
      }
    }
    joint.kind = KindOfJoint(model.jnt_type[i]);
    joint.limited = model.jnt_limited[i] != 0;
    joint.low = model.jnt_range[2 * i];
    joint.high = model.jnt_range[2 * i + 1];
    joint.force_limited = model.jnt_actfrclimited[i] != 0;
    joint.inertia = model.dof_M0[model.jnt_dofadr[i]];
    outline.joints.push_back(joint);
  }
  for (int i = 0; i < model.ntendon; ++i) outline.tendons.push_back(OutlineOfTendon(model, i));
  for (int i = 0; i < model.nactuator; ++i) {
    outline.actuators.push_back(OutlineOfActuator(model, i));
    const int joint = outline.actuators.back().joint;
    if (joint >= 0) outline.joints[static_cast<size_t>(joint)].actuated = true;
  }
  for (int i = 0; i < model.nsensor; ++i) {
    ModelOutline::Sensor sensor{ObjectName(model, mjOBJ_SENSOR, i), model.sensor_dim[i]};
    const int type = model.sensor_type[i];
    sensor.velocity = type == mjSENS_JOINTVEL;
    if (type == mjSENS_JOINTPOS || sensor.velocity) sensor.joint = model.sensor_objid[i];
    outline.sensors.push_back(std::move(sensor));
  }
  for (int i = 0; i < model.nkey; ++i) outline.keyframes.push_back(ObjectName(model, mjOBJ_KEY, i));
  if (model.njnt > 0) {
    for (const Observable& o : ResolveObservable(model, "joint/*/qpos", "")) outline.qpos.push_back(o.name);
    for (const Observable& o : ResolveObservable(model, "joint/*/qvel", "")) outline.qvel.push_back(o.name);
  }
  return outline;
}

}  // namespace oted
