#include "oted/stages/design/trajectories/distant_places.h"

#include <gtest/gtest.h>

#include <vector>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"

namespace oted::distant_places_test {

constexpr int kSteps = 10;

ParameterSpec PlaceOfWall(int axis, double model) {
  return {.name = "wall",
          .field = "body/wall/pos[" + std::to_string(axis) + "]",
          .low = model - 0.3,
          .high = model + 0.3,
          .scale = ParameterScale::kAbsolute};
}

/// What is found where the wall stands at `x`.
std::vector<Suspect> FoundWith(double x) {
  const TestFolder folder;
  const ModelTask task = HingeTask(folder, kBesideAWall);
  const ParameterSpec damping = {.name = "damping", .field = "joint/*/damping", .low = 0.5, .high = 2};
  const MujocoSimulatorFactory target(task, {PlaceOfWall(0, 0.6)}), factory(task, {damping});
  const Dataset logs = WithSensorNoise(LogsUnderTorques(target, {x}, 1.2), 0.002, RngKey(3));
  const ReadingModel readings = ReadingsOf(factory.spec(), logs, std::nullopt);
  WindowReplayer replayer = MakeReplayer(factory, 1, logs, readings, 1);
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
  const auto wide = factory.With({PlaceOfWall(0, 0.6), [] {
                                    ParameterSpec y = PlaceOfWall(1, 0);
                                    y.name = "wall_y";
                                    return y;
                                  }()});
  WindowReplayer wider = MakeReplayer(*wide, wide->parameters().size(), logs, readings, 1);
  const std::vector<ParameterSpec>& specs = wide->parameters().specs();
  return FindDistantPlaces({specs.begin() + 1, specs.end()}, fit, wider);
}

TEST(FindDistantPlaces, NamesTheWallThatStandsWhereTheModelTouchesNothing) {
  const std::vector<Suspect> found = FoundWith(0.44);
  ASSERT_EQ(found.size(), 1) << "aside, along the axis, it changes nothing";
  EXPECT_EQ(found.front().spec.field, "body/wall/pos[0]");
  EXPECT_NEAR(found.front().value, 0.44, 0.03);
}

TEST(FindDistantPlaces, FindsNothingWhereTheModelIsRight) { EXPECT_TRUE(FoundWith(0.6).empty()); }

TEST(IsPlace, IsACoordinateOnBothSidesOfTheModels) {
  ParameterSpec place = PlaceOfWall(0, 0.6);
  place.nominal = 0.6;
  EXPECT_TRUE(IsPlace(place));
  place.nominal = place.low;
  EXPECT_FALSE(IsPlace(place));
  EXPECT_FALSE(IsPlace({.name = "link", .field = "body/link/pos", .low = 0.5, .high = 2}));
}

}  // namespace oted::distant_places_test
