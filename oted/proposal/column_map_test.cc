#include "oted/proposal/column_map.h"

#include <gtest/gtest.h>

#include "oted/proposal/column_words.h"

namespace oted::column_map_test {

using Names = std::vector<std::string>;

/// An arm of two joints with a motor and a position servo, and an accelerometer.
ModelOutline Arm() {
  ModelOutline model;
  model.joints = {{.name = "shoulder_joint", .body = "upper"}, {.name = "elbow_joint", .body = "lower"}};
  model.actuators = {{.name = "shoulder_motor", .joint = 0, .drive = DriveKind::kMotor},
                     {.name = "elbow_servo", .joint = 1, .drive = DriveKind::kPositionServo}};
  model.sensors = {{"wrist_imu", 3}};
  model.qpos = {"joint/shoulder_joint/qpos", "joint/elbow_joint/qpos"};
  model.qvel = {"joint/shoulder_joint/qvel", "joint/elbow_joint/qvel"};
  return model;
}

/// "column -> path" of everything that matched.
Names Matched(const Names& columns, const ModelOutline& model = Arm()) {
  const ColumnMap map = MapColumns(columns, model);
  Names matched;
  for (const auto* entries : {&map.observations, &map.actions}) {
    for (const ColumnMap::Entry& entry : *entries) matched.push_back(entry.column + " -> " + entry.path);
  }
  return matched;
}

TEST(WordsOf, CutsAtSignsCapitalsAndDigits) {
  EXPECT_EQ(WordsOf("leftHip_vel[2]"), (Names{"left", "hip", "vel", "2"}));
  EXPECT_EQ(WordsOf("q1"), (Names{"q", "1"}));
  EXPECT_EQ(WordsOf("joint/hip/qpos"), (Names{"joint", "hip", "qpos"}));
}

TEST(MapColumns, NamesOfManyHousesMeanTheSame) {
  for (const Names& columns : {Names{"joint/shoulder_joint/qpos", "joint/elbow_joint/qvel", "actuator/shoulder_motor"},
                               Names{"obs.shoulder_pos", "obs.elbow_vel", "act.shoulder"},
                               Names{"shoulder.position", "elbow.velocity", "shoulder.effort"},
                               Names{"ShoulderJointAngle", "ElbowJointSpeed", "ShoulderMotorCommand"},
                               Names{"q_shoulder", "dq_elbow", "tau_shoulder"},
                               Names{"robot1_shoulder_joint", "robot1_elbow_joint_vel", "cmd_shoulder_motor"}}) {
    EXPECT_EQ(Matched(columns),
              (Names{columns[0] + " -> joint/shoulder_joint/qpos", columns[1] + " -> joint/elbow_joint/qvel",
                     columns[2] + " -> actuator/shoulder_motor"}));
  }
}

TEST(MapColumns, ActionsAreWhatTheActuatorTakes) {
  // A motor takes no position, a servo no torque, and nobody what was measured.
  EXPECT_EQ(Matched({"shoulder_pos_cmd", "shoulder_torque", "elbow_pos_cmd", "elbow_torque", "elbow_pos_measured"}),
            (Names{"elbow_pos_measured -> joint/elbow_joint/qpos", "shoulder_torque -> actuator/shoulder_motor",
                   "elbow_pos_cmd -> actuator/elbow_servo"}));
  EXPECT_TRUE(Matched({"shoulder_torque_measured"}).empty());
}

TEST(MapColumns, NumbersAreTheOrderWhereThereAreAsMany) {
  const ColumnMap map = MapColumns({"q2", "q1", "u0", "u1"}, Arm());
  ASSERT_EQ(map.observations.size(), 2u);
  EXPECT_EQ(map.observations[0].column, "q1");
  EXPECT_TRUE(map.observations[0].by_order);
  EXPECT_EQ(map.actions[1].path, "actuator/elbow_servo");
  EXPECT_TRUE(Matched({"q0", "q1", "q2"}).empty());
  EXPECT_TRUE(Matched({"q1", "q3"}).empty());
  EXPECT_EQ(MapColumns({"q0", "q1", "q2"}, Arm()).unused.size(), 3u);
  EXPECT_EQ(Matched({"obs_0", "obs_1", "obs_2", "obs_3"})[3], "obs_3 -> joint/elbow_joint/qvel");
}

TEST(MapColumns, TheOnlyCommandIsOfTheOnlyActuatorAndARateIsAVelocity) {
  ModelOutline balancer;
  balancer.joints = {{.name = "pitch", .body = "chassis"}};
  balancer.actuators = {{.name = "wheels"}};
  balancer.qpos = {"joint/pitch/qpos"};
  balancer.qvel = {"joint/pitch/qvel"};
  const ColumnMap map = MapColumns({"pitch", "pitch_rate", "motor_cmd"}, balancer);
  ASSERT_EQ(map.observations.size(), 2u);
  EXPECT_EQ(map.observations[1].path, "joint/pitch/qvel");
  ASSERT_EQ(map.actions.size(), 1u);
  EXPECT_EQ(map.actions[0].path, "actuator/wheels");
  EXPECT_FALSE(map.actions[0].by_order) << "no number was taken";
}

TEST(MapColumns, ThePlainerOfTwoNamesWins) {
  const ColumnMap map = MapColumns({"elbow_pos_filtered", "elbow_pos"}, Arm());
  ASSERT_EQ(map.observations.size(), 1u);
  EXPECT_EQ(map.observations[0].column, "elbow_pos");
  ASSERT_EQ(map.unused.size(), 1u);
  EXPECT_NE(map.unused[0].find("'elbow_pos' is joint/elbow_joint/qpos already"), std::string::npos);
}

TEST(MapColumns, AnAmbiguousEndingMatchesNothing) {
  ModelOutline model = Arm();
  model.joints = {{.name = "left_elbow", .body = "left"}, {.name = "right_elbow", .body = "right"}};
  model.actuators.clear();
  model.qpos = {"joint/left_elbow/qpos", "joint/right_elbow/qpos"};
  EXPECT_TRUE(Matched({"elbow_pos"}, model).empty());
  EXPECT_EQ(Matched({"left_elbow_pos"}, model), (Names{"left_elbow_pos -> joint/left_elbow/qpos"}));
}

TEST(MapColumns, AFreeJointHasAPlaceAnOrientationAndTheirVelocities) {
  ModelOutline model;
  model.joints = {{.name = "root", .body = "torso", .kind = JointKind::kFree}};
  for (int k = 0; k < 7; ++k) model.qpos.push_back("joint/root/qpos[" + std::to_string(k) + "]");
  for (int k = 0; k < 6; ++k) model.qvel.push_back("joint/root/qvel[" + std::to_string(k) + "]");
  model.actuators = {{.name = "fan", .joint = 0}};
  EXPECT_EQ(Matched({"root_z", "root_quat_w", "root_qy", "root_vz", "root_omega_x", "root_angular_velocity_z",
                     "root_roll", "fan_cmd"},
                    model),
            (Names{"root_z -> joint/root/qpos[2]", "root_quat_w -> joint/root/qpos[3]", "root_qy -> joint/root/qpos[5]",
                   "root_vz -> joint/root/qvel[2]", "root_omega_x -> joint/root/qvel[3]",
                   "root_angular_velocity_z -> joint/root/qvel[5]", "fan_cmd -> actuator/fan"}))
      << "a roll is no number of it";
}

TEST(MapColumns, SensorsHaveTheirNumbers) {
  EXPECT_EQ(Matched({"wrist_imu_y", "wrist_imu_9"}), (Names{"wrist_imu_y -> sensor/wrist_imu[1]"}));
}

TEST(MapColumns, ASensorOfAJointsPositionIsThatPosition) {
  ModelOutline model = Arm();
  model.sensors.push_back({.name = "elbow-pos", .joint = 1});
  model.sensors.push_back({.name = "elbow-vel", .joint = 1, .velocity = true});
  EXPECT_EQ(Matched({"elbow_pos", "elbow_vel"}, model),
            (Names{"elbow_pos -> joint/elbow_joint/qpos", "elbow_vel -> joint/elbow_joint/qvel"}));
}

TEST(MapColumns, WithoutActuatorsJointsGetMotors) {
  ModelOutline model = Arm();
  model.actuators.clear();
  const ColumnMap map = MapColumns({"elbow_pos", "elbow_effort"}, model);
  EXPECT_EQ(map.motors, (Names{"joint/elbow_joint"}));
  EXPECT_EQ(map.actions[0].path, "actuator/elbow_joint");
}

TEST(MapColumns, TimesAndEpisodesAreNoUnknowns) {
  const ColumnMap map = MapColumns({"time", "stamp_ms", "trial", "elbow_pos_deg", "battery"}, Arm());
  EXPECT_EQ(map.time, "") << "the reader finds it by itself";
  EXPECT_EQ(map.episode, "trial");
  EXPECT_TRUE(map.observations.at(0).in_degrees);
  EXPECT_EQ(map.unused, (Names{"'battery': nothing in the model has such a name"}));
}

TEST(MapColumns, StampsInTheirUnitAreTheTimesWhereNoOthersAre) {
  EXPECT_EQ(MapColumns({"stamp_ms", "elbow_pos"}, Arm()).time, "stamp_ms");
  const ColumnMap map = MapColumns({"t_ms", "elbow_pos"}, Arm());
  EXPECT_EQ(map.time, "");
  EXPECT_TRUE(map.unused.empty());
}

}  // namespace oted::column_map_test
