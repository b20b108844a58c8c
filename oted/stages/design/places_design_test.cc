// Where something stands that the robot touches, and that the model does not reach, found by a design that searches it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/verdict.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::places_design_test {

TEST(DesignBesideAWall, FindsTheWallThatTheModelNeverTouches) {
  const TestFolder folder;
  const ParameterSpec wall = {
      .name = "wall", .field = "body/wall/pos[0]", .low = 0.3, .high = 0.9, .scale = ParameterScale::kAbsolute};
  const ParameterSpec damping = {.name = "damping", .field = "joint/*/damping", .low = 0.5, .high = 2};
  const MujocoSimulatorFactory factory(HingeTask(folder, kBesideAWall), {wall, damping});
  NullSink log;
  const Prior prior = Prior::Uniform(2);
  const RunContext context{.log = &log, .n_threads = 1};
  for (const double truth : {0.435, 0.46}) {
    const Dataset logs = WithSensorNoise(LogsUnderTorques(factory, {truth, 1.3}, 1.2), 0.002, RngKey(3));
    const ReplayFit fit =
        MatchTrajectories({factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                          {.rows = 800, .starts = 1, .coarse = 1});
    const Designer q(factory.parameters(), fit.mean, fit.covariance);
    EXPECT_NEAR(q.Mode()[0], truth, 0.002);
    EXPECT_NEAR(q.Mode()[1], 1.3, 0.05);
    const auto intervals = q.CentralInterval(0.98);
    EXPECT_LE(intervals[0].low, truth);
    EXPECT_GE(intervals[0].high, truth);
    EXPECT_FALSE(fit.evidence->own_logs.empty()) << "few windows tell of it, and they through contact";
  }
}

}  // namespace oted::places_design_test
