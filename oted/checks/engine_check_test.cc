#include "oted/checks/engine_check.h"

#include <gtest/gtest.h>

#include "oted/collect/demonstrations.h"
#include "oted/collect/excitation.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::engine_check_test {

constexpr int kRows = 200;

Dataset Logs(const std::string& task) {
  return CollectExcitation(MujocoSimulatorFactory(task, {}), {}, *Excitation::Parse("random"), 10, RngKey(1), 1);
}

std::optional<EngineMatch> Better(const std::string& logged_in, const std::string& task) {
  const Dataset logs = Logs(logged_in);
  const OneStepError here = MeasureOneStep(MujocoSimulatorFactory(task, {}), logs, kRows, 1);
  return FindBetterEngine(task, here, logs, kRows, 1);
}

TEST(FindBetterEngine, LogsOfTheOldEngineAreToldInTodaysTask) {
  for (const std::string robot : {"Hopper", "HalfCheetah", "Walker2d"}) {
    const auto match = Better(robot + "-v2", robot + "-v5");
    ASSERT_TRUE(match.has_value()) << robot;
    EXPECT_EQ(match->task, robot + "-v2");
    EXPECT_LT(match->ratio, 1e-4);
  }
}

TEST(FindBetterEngine, SeesNothingInLogsOfTheTaskItself) {
  EXPECT_FALSE(Better("Hopper-v5", "Hopper-v5").has_value());
  EXPECT_FALSE(Better("Hopper-v4", "Hopper-v5").has_value()) << "they differ in the reward alone";
}

}  // namespace oted::engine_check_test
