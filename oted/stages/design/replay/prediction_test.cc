#include "oted/stages/design/replay/prediction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::prediction_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

struct Judged {
  explicit Judged(const Dataset& logs, double noise, int n_steps = 10)
      : replayer(PointMassFactory().Make(WindowReplayer::LinearizationLanes(0, 2), 1), logs),
        judge(replayer, logs, VectorXd::Constant(2, noise), n_steps, 0.1) {}
  WindowReplayer replayer;
  PredictionJudge judge;
};

TEST(PredictionJudge, TheLogsOwnSimulatorPredictsCleanLogsExactly) {
  const Dataset logs = PointMassLogs(kTruth, 5);
  Judged judged(logs, 1e-6);
  for (const VectorXd& rms : judged.judge.Rms(kTruth, {1, 10})) EXPECT_LT(rms.maxCoeff(), 1e-6);
}

TEST(PredictionJudge, UnderNoiseTheLogsOwnSimulatorComesToTheSensorsFloor) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 100), 0.05, RngKey(2));
  Judged judged(logs, 0.05);
  // A prediction misses a reading by the reading's noise and by what is unknown of the start.
  const std::vector<VectorXd> rms = judged.judge.Rms(kTruth, {10});
  EXPECT_GT(rms[0].minCoeff(), 0.045);
  EXPECT_LT(rms[0][1], 0.06) << "of the velocity, whose start is damped away";
}

TEST(PredictionJudge, AnotherSimulatorIsFartherOffTheLongerItPredicts) {
  const Dataset logs = PointMassLogs(kTruth, 20);
  Judged judged(logs, 1e-6);
  const std::vector<VectorXd> rms = judged.judge.Rms({1.0, 0.6, 0.5}, {2, 10});
  EXPECT_GT(rms[0][0], 1e-3);
  EXPECT_GT(rms[1][0], rms[0][0]);
}

TEST(PredictHeldOut, GivesBothSimulatorsAtEveryHorizonThatTheEpisodesHold) {
  const Dataset logs = PointMassLogs(kTruth, 5);  // 2 s each
  Judged judged(logs, 1e-6, 10);
  const HeldOutPrediction prediction = PredictHeldOut(judged.judge, {1.0, 1.0, 0.5}, kTruth, 0.1);
  ASSERT_EQ(prediction.horizons.size(), 3u);
  EXPECT_DOUBLE_EQ(prediction.horizons[1].seconds, 0.5);
  for (const auto& horizon : prediction.horizons) EXPECT_LT(horizon.designed[0], 1e-3 * horizon.nominal[0]);
  // Episodes too short for the lead and a prediction give none.
  PointMassOptions brief;
  brief.max_episode_steps = 4;
  const Dataset short_logs = PointMassLogs(kTruth, 3, brief);
  Judged none(short_logs, 1e-6);
  EXPECT_TRUE(PredictHeldOut(none.judge, kTruth, kTruth, 0.1).horizons.empty());
}

}  // namespace oted::prediction_test
