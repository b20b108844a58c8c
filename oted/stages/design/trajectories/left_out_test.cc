#include "oted/stages/design/trajectories/left_out.h"

#include <gtest/gtest.h>

#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/long_windows.h"

namespace oted::left_out_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};
const VectorXd kNoise = VectorXd::Constant(2, 1e-3);

/// Logs, and a fit of windows of five steps that has learned from all of them.
struct Learned {
  explicit Learned(Dataset dataset, std::vector<int> recording = {})
      : parts(AllLearn(std::move(dataset), std::move(recording))),
        readings(ReadingModel::Of(factory.spec(), logs)),
        replayer(factory.Make(64, 1), logs),
        left_out({.factory = factory, .parts = parts, .readings = readings, .noise = kNoise, .predicted_s = 0.5}, 1),
        scale(ChannelScales(logs)),
        fit(replayer, factory.parameters(), prior, scale, LongWindows(replayer, logs, 5, logs.size(), 0.1),
            VectorXd::Zero(3)) {
    fit.Descend(12, [](const VectorXd&) {});
  }

  HeldOutParts parts;
  const Dataset& logs = parts.learn;
  PointMassFactory factory;
  ReadingModel readings;
  WindowReplayer replayer;
  LeftOutRecordings left_out;
  Prior prior = Prior::Uniform(3);
  VectorXd scale;
  LevelFit fit;
};

TEST(LeftOutRecordings, OneSimulatorBehindAllPredictsWhatWasLeftOutAsWell) {
  const Dataset logs = PointMassLogs(kTruth, 6);
  Learned all(logs);
  EXPECT_EQ(all.left_out.n_parts(), 6);
  int n_told = 0;
  const Eigen::MatrixXd errors = all.left_out.ErrorsOf(all.fit, [&] { ++n_told; });
  EXPECT_EQ(errors.cols(), all.left_out.n_windows());
  EXPECT_LE(errors.maxCoeff(), 1.01 * kNoise.cwiseAbs2().maxCoeff());
  EXPECT_GE(n_told, 6);
}

TEST(LeftOutRecordings, ARecordingOfItsOwnKindIsPredictedAsByTheOthers) {
  // The last one, in two episodes, is of another gain: what a fit learned from it does not count.
  Dataset logs = PointMassLogs(kTruth, 2);
  logs.Append(PointMassLogs({0.8, 0.6, 0.5}, 2));
  Learned all(WithSensorNoise(logs, 0.1, RngKey(1)), {0, 1, 2, 2});
  ASSERT_EQ(all.left_out.n_parts(), 3);
  const Eigen::MatrixXd as_learned = all.left_out.ErrorsAt(all.fit.x());
  const Eigen::MatrixXd left_out = all.left_out.ErrorsOf(all.fit, [] {});
  const std::vector<double> truth = ZToLogit(all.factory.parameters(), kTruth);
  const Eigen::MatrixXd by_others = all.left_out.ErrorsAt(Eigen::Map<const VectorXd>(truth.data(), 3));
  const Eigen::Index n = left_out.cols() / 2;
  const double wanted = by_others.rightCols(n).sum();
  EXPECT_NEAR(left_out.rightCols(n).sum() / wanted, 1, 0.1);
  EXPECT_LT(as_learned.rightCols(n).sum(), 0.7 * wanted);

  const LeftOutInTurn in_turn = all.left_out.BesideNominal(left_out, as_learned);
  EXPECT_TRUE(in_turn.recordings);
  ASSERT_EQ(in_turn.parts.size(), 3u);
  EXPECT_GT(in_turn.parts[2].error, 1.1) << "more than what the fit made of it that has learned from it";
  EXPECT_TRUE(in_turn.parts[2].sure);
  EXPECT_EQ(in_turn.parts[1].episodes, std::vector<int>{1});
  EXPECT_EQ(in_turn.parts[2].episodes, std::vector<int>{2}) << "a recording is named by its first episode";
}

TEST(LeftOutRecordings, OneRecordingIsCutInTimeAndAWindowAcrossTheCutGoesWithBoth) {
  Dataset logs = PointMassLogs(kTruth, 1, {.max_episode_steps = 120});  // 12 s
  Learned one(logs, {0});
  ASSERT_EQ(one.left_out.n_parts(), 6);
  EXPECT_EQ(one.left_out.Touches({{0, 5, 0}, {18, 5, 0}, {20, 5, 0}}, 0), (std::vector<char>{1, 1, 0}));
  EXPECT_EQ(one.left_out.Touches({{0, 5, 0}, {18, 5, 0}, {20, 5, 0}}, 1), (std::vector<char>{0, 1, 1}));
}

TEST(LeftOutRecordings, LogsTooShortToCutJudgeNothing) {
  Learned brief(PointMassLogs(kTruth, 1), {0});  // 2 s
  EXPECT_EQ(brief.left_out.n_parts(), 0);
  EXPECT_EQ(brief.left_out.n_windows(), 0);
}

}  // namespace oted::left_out_test
