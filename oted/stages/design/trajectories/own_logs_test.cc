#include "oted/stages/design/trajectories/own_logs.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/level_fit.h"
#include "oted/stages/design/trajectories/own_designs.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::own_logs_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};
constexpr int kSteps = 10, kWindowsPerEpisode = 2;

TEST(OwnLogs, AreWhatTheSimulatorMakesOfTheExplainedWindows) {
  Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 10), 0.05, RngKey(1));
  // The last episode is of nothing that the simulator does.
  const Episode spoilt = logs.Episodes().back();
  for (int row = spoilt.begin; row < spoilt.end; ++row) logs.observations(row, 0) += row % 2 == 0 ? 3 : -3;
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  Level level;
  for (const Episode& episode : logs.Episodes()) {
    for (int k = 0; k < kWindowsPerEpisode; ++k) {
      level.windows.push_back({episode.begin + k * kSteps, kSteps, episode.begin});
      level.starts.push_back(replayer.Logged(level.windows.back(), 0));
      level.stretch.push_back(episode.begin);
    }
  }
  const ParameterSpace space = PointMass::MakeParameters();
  const Prior prior = Prior::Uniform(3);
  const VectorXd scale = ChannelScales(logs);
  const std::vector<double> x = ZToLogit(space, kTruth);
  LevelFit fit(replayer, space, prior, scale, level, Eigen::Map<const VectorXd>(x.data(), 3));
  for (int i = 0; i < 8; ++i) fit.Step();
  fit.FinalCost();
  Rng rng(2);
  const Dataset own = OwnLogs(replayer, fit, kTruth, VectorXd::Zero(2), Through::kExplained, rng);
  WindowReplayer again(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), own);
  for (const Episode& episode : logs.Episodes()) {
    if (episode.begin == spoilt.begin) {
      for (int row = episode.begin; row < episode.end; ++row) {
        EXPECT_EQ(own.observations(row, 0), logs.observations(row, 0)) << "not explained";
      }
      continue;
    }
    // Both windows are one replay, which the truth follows exactly from its own reading.
    const LogWindow whole{episode.begin, kWindowsPerEpisode * kSteps, episode.begin};
    const VectorXd left = again.Residuals({whole}, {again.Logged(whole, 0)}, kTruth)[0];
    EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-9) << episode.begin;
  }
  // Through all windows the spoilt episode is the simulator's own as well.
  const Dataset whole = OwnLogs(replayer, fit, kTruth, VectorXd::Zero(2), Through::kAll, rng);
  WindowReplayer of_whole(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), whole);
  const LogWindow last{spoilt.begin, kWindowsPerEpisode * kSteps, spoilt.begin};
  EXPECT_LT(of_whole.Residuals({last}, {of_whole.Logged(last, 0)}, kTruth)[0].cwiseAbs().maxCoeff(), 1e-9);
}

TEST(AsWideAs, WidensWhereDesignsLieFartherOffThanTheCovarianceSaysAndNowhereElse) {
  MatrixXd covariance(2, 2);
  covariance << 4, 0, 0, 1;
  EXPECT_EQ(AsWideAs({}, 1, covariance), covariance);
  // Six along the first axis is three standard deviations; a half along the second is less than one.
  const MatrixXd wider =
      AsWideAs({Vector2d(6, 0), Vector2d(-6, 0), Vector2d(0, 0.5), Vector2d(0, -0.5)}, 1, covariance);
  EXPECT_NEAR(wider(0, 0), 18, 1e-12) << "the mean square";
  EXPECT_NEAR(wider(1, 1), 1, 1e-12);
  EXPECT_NEAR(wider(0, 1), 0, 1e-12);
  // From half the rows they scatter twice as much by themselves.
  EXPECT_NEAR(AsWideAs({Vector2d(6, 0), Vector2d(-6, 0)}, 2, covariance)(0, 0), 32, 1e-12);
}

TEST(AsWideAs, BeyondABoundIsAtTheBound) { EXPECT_EQ(Off(Vector2d(14, -1), Vector2d(6, -2)), Vector2d(0, 1)); }

// A leg that hops on a guide: positions alone, with noise of a hundredth of a radian and of half a centimetre.
constexpr const char* kLeg = R"(<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody><geom name="floor" type="plane" size="5 5 .1" friction="0.8"/>
    <body pos="0 0 0.55"><joint name="height" type="slide" axis="0 0 1" damping="0.5"/>
      <inertial pos="0 0 0" mass="2.5" diaginertia=".02 .02 .02"/>
      <body name="thigh"><joint name="hip" axis="0 1 0" damping="0.2" armature="0.01" range="-1.5 1.5"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.28" size=".02" mass=".5"/>
        <body pos="0 0 -0.28"><joint name="knee" axis="0 1 0" damping="0.2" armature="0.01" range="-2.4 0.1"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.28" size=".02" mass=".35"/></body></body></body></worldbody>
  <actuator><position name="hip" joint="hip" kp="80" kv="1.5" ctrlrange="-1 1"/>
    <position name="knee" joint="knee" kp="80" kv="1.5" ctrlrange="-2 0"/></actuator>
</mujoco>)";

TEST(DesignsFromOwnLogs, TellHowFarAFitRestsFromTheTruthWhereWindowsHaveLocalMinima) {
  const TestFolder folder;
  ModelTask task = HingeTask(folder, kLeg);
  task.observations = {"joint/*/qpos"};
  task.actions = {"actuator/*"};
  task.control_period = 0.02;
  const MujocoSimulatorFactory factory(
      task, {{.name = "kp", .field = "actuator/*/kp", .low = 0.5, .high = 2, .logarithmic = true},
             {.name = "damping", .field = "joint/@actuated/damping", .low = 0.3, .high = 3, .logarithmic = true}});
  const std::vector<double> truth = {0.85, 1.6};
  const auto target = factory.Make(1, 1);
  target->SetParameters(0, truth);
  Dataset logs;
  Rng rng(5);
  for (int episode = 0; episode < 4; ++episode) {
    target->Reset(0, rng);
    const double rate = rng.Uniform(0.16, 0.29);
    const auto action = [&](int i) {
      return std::vector<double>{0.5 + 0.3 * std::sin(rate * i), -1.0 - 0.6 * std::sin(rate * i)};
    };
    AppendEpisode(*target, 100, action, logs);
  }
  logs = WithSensorNoise(logs, 0.01, RngKey(9));
  NullSink log;
  const ReplayFit fit =
      MatchTrajectories({factory, logs, Prior::Uniform(2), RngKey(1), [](int, int, const VectorXd&) {}, {.log = &log}},
                        {.rows = 400, .starts = 2, .coarse = 16});
  const auto intervals = Designer(factory.parameters(), fit.mean, fit.covariance).CentralInterval(0.9);
  EXPECT_EQ(fit.evidence->own_logs.size(), 4U) << "two lie farther off than the covariance says";
  EXPECT_EQ(fit.evidence->unsettled.size(), 2U) << "nothing is identified where velocities are unread as well";
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_LE(intervals[i].low, truth[i]);
    EXPECT_GE(intervals[i].high, truth[i]);
    EXPECT_LT(intervals[i].high, 1.3 * intervals[i].low) << "not all of the range either";
  }
}

}  // namespace oted::own_logs_test
