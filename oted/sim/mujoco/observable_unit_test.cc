#include "oted/sim/mujoco/observable_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/testing.h"

namespace oted {
namespace {

using ::testing::ElementsAre;

class ObservableUnit : public ::testing::Test {
 protected:
  /// The units of everything that `path` names.
  std::vector<std::string> Units(const std::string& path) const {
    std::vector<std::string> units;
    for (const Observable& o : ResolveObservable(factory_.model(), path, path)) {
      units.push_back(UnitOf(factory_.model(), o));
    }
    return units;
  }

  TestFolder folder_;
  MujocoSimulatorFactory factory_{CrawlerTask(folder_), {}};
};

TEST_F(ObservableUnit, AFreeJointSlidesThenTurnsAndAQuaternionHasNone) {
  EXPECT_THAT(Units("joint/root/qpos"), ElementsAre("m", "m", "m", "", "", "", ""));
  EXPECT_THAT(Units("joint/root/qvel"), ElementsAre("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s"));
  EXPECT_THAT(Units("joint/neck/qpos"), ElementsAre("", "", "", ""));
  EXPECT_THAT(Units("joint/neck/qvel"), ElementsAre("rad/s", "rad/s", "rad/s"));
}

TEST_F(ObservableUnit, HingesTurnAndSlidesSlide) {
  EXPECT_THAT(Units("joint/wrist/qpos"), ElementsAre("rad"));
  EXPECT_THAT(Units("joint/extend/qpos"), ElementsAre("m"));
  EXPECT_THAT(Units("joint/extend/qacc"), ElementsAre("m/s^2"));
  EXPECT_THAT(Units("joint/wrist/qfrc_actuator"), ElementsAre("N m"));
}

TEST_F(ObservableUnit, ASensorHasThatOfWhatItMeasures) {
  EXPECT_THAT(Units("sensor/accel"), ElementsAre("m/s^2", "m/s^2", "m/s^2"));
  EXPECT_THAT(Units("sensor/touch"), ElementsAre("N"));
  EXPECT_THAT(Units("sensor/hip_angle"), ElementsAre("rad"));
  EXPECT_THAT(Units("sensor/hip_speed"), ElementsAre("rad/s"));
  EXPECT_THAT(Units("sensor/com_speed"), ElementsAre("m/s", "m/s", "m/s"));
}

TEST_F(ObservableUnit, AnActuatorHasThatOfWhatItMovesAndJointsInOneTendonHaveNone) {
  EXPECT_THAT(Units("actuator/hip/force"), ElementsAre("N m"));
  EXPECT_THAT(Units("actuator/hip/length"), ElementsAre("rad"));
  EXPECT_THAT(Units("actuator/line/force"), ElementsAre("")) << "it pulls a hinge and a slide";
  EXPECT_THAT(Units("tendon/line/length"), ElementsAre(""));
  EXPECT_THAT(Units("site/tip/xpos[1]"), ElementsAre("m"));
}

TEST_F(ObservableUnit, TheZeroOfASensorOfAnOwnModelIsASuspect) {
  std::vector<std::string> fields;
  for (const ParameterSpec& suspect : factory_.Suspects()) fields.push_back(suspect.field);
  EXPECT_THAT(fields, ::testing::Contains("obs/joint/wrist/qpos/bias"));
  EXPECT_THAT(fields, ::testing::Contains("obs/sensor/hip_angle/bias"));
  EXPECT_THAT(fields, ::testing::Contains("obs/joint/wrist/qvel/bias"));
}

}  // namespace
}  // namespace oted
