#pragma once
/// Models and task files for tests. Include from *_test.cc files only.

#include <string>

#include "oted/base/testing.h"
#include "oted/sim/mujoco/model_task.h"

namespace oted {

/// A free box with a ball joint, a hinge, a slide on a tendon, an IMU, filtered and plain actuators, a keyframe and a
/// floor.
inline constexpr const char* kCrawlerXml = R"(<mujoco model="crawler">
  <option timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="20 20 1"/>
    <body name="torso" pos="0 0 0.3">
      <freejoint name="root"/>
      <geom name="torso" type="box" size="0.2 0.1 0.05"/>
      <site name="imu" pos="0.05 0 0.05" euler="10 20 30"/>
      <body name="arm" pos="0.25 0 0">
        <joint name="neck" type="ball" damping="0.05"/>
        <geom name="arm" type="capsule" fromto="0 0 0 0.2 0 0" size="0.03"/>
        <body name="hand" pos="0.2 0 0">
          <joint name="wrist" axis="0 1 0" damping="0.02"/>
          <joint name="extend" type="slide" axis="1 0 0" range="0 0.1" limited="true" damping="0.5"/>
          <geom name="hand" type="sphere" size="0.04" pos="0.05 0 0"/>
          <site name="tip" pos="0.1 0 0"/>
        </body>
      </body>
      <body name="leg" pos="-0.2 0 -0.05">
        <joint name="hip" axis="0 1 0" damping="0.1"/>
        <geom name="leg" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03"/>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="line"><joint joint="wrist" coef="0.5"/><joint joint="extend" coef="-1"/></fixed></tendon>
  <actuator>
    <motor name="hip" joint="hip" gear="2" ctrlrange="-1 1" ctrllimited="true"/>
    <general name="wrist" joint="wrist" dyntype="filter" dynprm="0.05" gainprm="0.3" ctrlrange="-2 1" ctrllimited="true"/>
    <position name="line" tendon="line" kp="3" ctrlrange="-0.2 0.2" ctrllimited="true"/>
  </actuator>
  <sensor>
    <accelerometer name="accel" site="imu"/>
    <gyro name="gyro" site="imu"/>
    <touch name="touch" site="tip"/>
    <jointpos name="hip_angle" joint="hip"/>
    <jointvel name="hip_speed" joint="hip"/>
    <subtreelinvel name="com_speed" body="torso"/>
  </sensor>
  <keyframe><key name="ready" qpos="0 0 0.35 1 0 0 0 1 0 0 0 0.1 0.02 -0.3" ctrl="0.1 0 0.05"/></keyframe>
</mujoco>
)";

/// The crawler with everything that determines its state observed, but x and y.
inline ModelTask CrawlerTask(const TestFolder& folder) {
  WriteFileAtomically(folder / "crawler.xml", kCrawlerXml);
  ModelTask task;
  task.name = "Crawler";
  task.model = folder / "crawler.xml";
  task.control_period = 0.02;
  task.observations = {"joint/root/qpos[2]", "joint/root/qpos[3]", "joint/root/qpos[4]", "joint/root/qpos[5]",
                       "joint/root/qpos[6]", "joint/neck/qpos",    "joint/wrist/qpos",   "joint/extend/qpos",
                       "sensor/hip_angle",   "joint/*/qvel",       "actuator/*/act",     "sensor/gyro"};
  task.unobserved = {"joint/root/qpos[0]", "joint/root/qpos[1]"};
  task.start = "keyframe/ready";
  task.start_noise = 0.05;
  task.quantities = {{"torso", "body/torso/xpos"}, {"hip", "joint/hip/qpos"}};
  task.reward = "d_torso[0] + 2 * torso[2] - 0.1 * sum2_action - 0.01 * abs(d_hip) + 0.001 * t + action[0] * dt";
  task.terminate = "torso[2] < 0.1 || hip > 2";
  task.max_episode_steps = 70;
  return task;
}

/// The same with observations that show no state.
inline ModelTask BlindCrawlerTask(const TestFolder& folder) {
  ModelTask task = CrawlerTask(folder);
  task.observations = {"sensor/*", "site/tip/xpos", "tendon/line/length", "actuator/*/force"};
  task.unobserved.clear();
  task.reward.clear();
  return task;
}

}  // namespace oted
