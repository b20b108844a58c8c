#include "oted/stages/design/trajectories/distant_values.h"

#include <gtest/gtest.h>

#include <vector>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"

namespace oted::distant_values_test {

constexpr int kSteps = 10;

ParameterSpec PlaceOfWall(int axis, double model) {
  return {.name = "wall",
          .field = "body/wall/pos[" + std::to_string(axis) + "]",
          .low = model - 0.3,
          .high = model + 0.3,
          .scale = ParameterScale::kAbsolute};
}

/// What is found of `specs` where the first of them is `value`.
std::vector<Suspect> FoundWith(const std::vector<ParameterSpec>& specs, double value) {
  const TestFolder folder;
  const ModelTask task = HingeTask(folder, kBesideAWall);
  const ParameterSpec damping = {.name = "damping", .field = "joint/*/damping", .low = 0.5, .high = 2};
  const MujocoSimulatorFactory target(task, {specs.front()}), factory(task, {damping});
  const Dataset logs = WithSensorNoise(LogsUnderTorques(target, {value}, 1.2), 0.002, RngKey(3));
  const ReadingModel readings = ReadingsOf(factory.spec(), logs, std::nullopt);
  WindowReplayer replayer = MakeReplayer(factory, logs, readings, 1);
  Level level;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin; i + kSteps <= episode.end; i += kSteps) {
      level.windows.push_back({i, kSteps, episode.begin});
      level.stretch.push_back(episode.begin);
    }
  }
  level.starts = LoggedStarts(replayer, level.windows);
  const Prior prior = Prior::Uniform(1);
  const Eigen::VectorXd scale = ChannelScales(logs);
  LevelFit fit(replayer, factory.parameters(), prior, scale, level, NominalStart(factory.parameters()));
  fit.Descend(8, [](const Eigen::VectorXd&) {});
  fit.FinalCost();
  const auto wide = factory.With(specs);
  WindowReplayer wider = MakeReplayer(*wide, logs, readings, 1);
  const std::vector<ParameterSpec>& all = wide->parameters().specs();
  return FindDistant({all.begin() + 1, all.end()}, fit, wider);
}

/// The same where the wall stands at `x`.
std::vector<Suspect> FoundWithWall(double x) {
  ParameterSpec aside = PlaceOfWall(1, 0);
  aside.name = "wall_y";
  return FoundWith({PlaceOfWall(0, 0.6), aside}, x);
}

/// A limit that the motor's model lacks and where the wall stands.
std::vector<ParameterSpec> LimitAndWall() {
  return {{.name = "limit",
           .field = "actuator/motor/force_limit",
           .low = 0.003,
           .high = 600,
           .scale = ParameterScale::kAbsolute,
           .logarithmic = true},
          PlaceOfWall(0, 0.6)};
}

TEST(FindDistant, NamesTheWallThatStandsWhereTheModelTouchesNothing) {
  const std::vector<Suspect> found = FoundWithWall(0.44);
  ASSERT_EQ(found.size(), 1) << "aside, along the axis, it changes nothing";
  EXPECT_EQ(found.front().spec.field, "body/wall/pos[0]");
  EXPECT_NEAR(found.front().value, 0.44, 0.03);
}

TEST(FindDistant, FindsNothingWhereTheModelIsRight) { EXPECT_TRUE(FoundWithWall(0.6).empty()); }

TEST(FindDistant, NamesTheForceThatADriveCannotExceed) {
  const std::vector<Suspect> found = FoundWith(LimitAndWall(), 0.8);  // 1.2 N m and more are asked for
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().spec.field, "actuator/motor/force_limit");
  EXPECT_NEAR(found.front().value, 0.8, 0.3) << "the nearest half of halves";
}

TEST(FindDistant, FindsNoLimitWhereNoneActs) { EXPECT_TRUE(FoundWith(LimitAndWall(), 300).empty()); }

TEST(FindDistant, ALimitWhoseRangeBeginsAtNothingIsAskedAFewTimes) {
  std::vector<ParameterSpec> specs = LimitAndWall();
  specs.front().low = 0;
  specs.front().high = 1000;
  specs.front().logarithmic = false;
  const std::vector<Suspect> found = FoundWith(specs, 0.8);
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found.front().value, 0.8, 0.3);
}

TEST(IsLimit, IsALargestForce) {
  EXPECT_TRUE(IsLimit(LimitAndWall().front()));
  EXPECT_FALSE(IsLimit({.name = "gear", .field = "actuator/motor/gear[0]", .low = 0.5, .high = 2}));
}

TEST(IsPlace, IsACoordinateOnBothSidesOfTheModels) {
  ParameterSpec place = PlaceOfWall(0, 0.6);
  place.nominal = 0.6;
  EXPECT_TRUE(IsPlace(place));
  place.nominal = place.low;
  EXPECT_FALSE(IsPlace(place));
  EXPECT_FALSE(IsPlace({.name = "link", .field = "body/link/pos", .low = 0.5, .high = 2}));
}

}  // namespace oted::distant_values_test
