#include "oted/stages/design/replay/prediction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/replay/reading_model.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/testing.h"

namespace oted::prediction_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

struct Judged {
  explicit Judged(const Dataset& logs, double noise, int n_steps = 10)
      : replayer(PointMassFactory().Make(64, 1), logs),
        judge(replayer, logs, VectorXd::Constant(2, noise), {n_steps}, 0.1) {}
  WindowReplayer replayer;
  PredictionJudge judge;
};

/// (channels): root mean square over windows.
VectorXd Rms(const Judged& judged, const std::vector<double>& z) {
  return judged.judge.Predict(z).predicted[0].rowwise().mean().cwiseSqrt();
}

TEST(PredictionJudge, TheLogsOwnSimulatorPredictsCleanLogsExactly) {
  const Dataset logs = PointMassLogs(kTruth, 5);
  EXPECT_LT(Rms(Judged(logs, 1e-6), kTruth).maxCoeff(), 1e-6);
}

TEST(PredictionJudge, UnderNoiseTheLogsOwnSimulatorComesToTheSensorsFloor) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 100), 0.05, RngKey(2));
  // A prediction misses a reading by the reading's noise and by what is unknown of the start.
  const VectorXd rms = Rms(Judged(logs, 0.05), kTruth);
  EXPECT_GT(rms.minCoeff(), 0.045);
  EXPECT_LT(rms[1], 0.06) << "of the velocity, whose start is damped away";
}

/// Between walls that throw it back, seen by its position alone.
class UnseenBetweenWalls : public PositionAlone {
 public:
  using PositionAlone::PositionAlone;
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    PositionAlone::Step(lanes, actions);
    for (const int lane : lanes) {
      const std::span<const double> state = PointMass::observation(lane);
      if (std::abs(state[0]) > 0.3 && state[0] * state[1] > 0) {
        PointMass::SetStateFromObservation(lane, std::vector<double>{state[0], -0.9 * state[1]});
      }
    }
  }
};

class UnseenBetweenWallsFactory : public PositionAloneFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<UnseenBetweenWalls>(n_lanes, n_threads);
  }
};

TEST(PredictionJudge, ALeadWhoseFirstFitIsCaughtByAContactIsFittedAgain) {
  UnseenBetweenWalls target(40, 1);
  const Dataset logs = RandomLogs(target, kTruth);
  const UnseenBetweenWallsFactory factory;
  WindowReplayer replayer = MakeReplayer(factory, logs, ReadingModel::Of(factory.spec(), logs, {}), 1);
  const PredictionJudge judge(replayer, logs, VectorXd::Constant(1, 1e-6), {4}, 0.0125);
  ASSERT_GT(judge.n_windows(), 50);
  const Eigen::MatrixXd lead = judge.Predict(kTruth).lead;
  const double found = static_cast<double>((lead.array() < 1e-10).count()) / static_cast<double>(lead.cols());
  EXPECT_GT(found, 0.9);
}

TEST(PredictionJudge, AnotherSimulatorIsFartherOffTheLongerItPredicts) {
  const Dataset logs = PointMassLogs(kTruth, 20);
  const double brief = Rms(Judged(logs, 1e-6, 2), {1.0, 0.6, 0.5})[0];
  EXPECT_GT(brief, 1e-3);
  EXPECT_GT(Rms(Judged(logs, 1e-6, 10), {1.0, 0.6, 0.5})[0], brief);
}

TEST(PredictionJudge, AnImitationIsWhatTheSimulatorWouldHaveLogged) {
  const Dataset logs = PointMassLogs(kTruth, 5);
  const std::vector<double> other = {1.0, 0.6, 0.5};
  const Judged judged(logs, 1e-6);
  Rng rng = RngKey(3).MakeRng();
  const Dataset made = judged.judge.Imitate(judged.judge.Follow(other, judged.judge.Predict(other).starts, [] {}),
                                            VectorXd::Zero(2), rng);
  ASSERT_EQ(static_cast<int>(made.Episodes().size()), judged.judge.n_windows());
  WindowReplayer replayer(PointMassFactory().Make(64, 1), made);
  const PredictionJudge same(replayer, made, judged.judge);
  EXPECT_EQ(same.n_windows(), judged.judge.n_windows());
  EXPECT_LT(same.Predict(other).predicted[0].maxCoeff(), 1e-12) << "its own logs it predicts exactly";
  EXPECT_GT(same.Predict(kTruth).predicted[0].maxCoeff(), 1e-6);
  // Noise is on every reading, and one reading has one value.
  const VectorXd noise = Eigen::Vector2d(0.05, 0);
  const Dataset noisy =
      judged.judge.Imitate(judged.judge.Follow(other, judged.judge.Predict(other).starts, [] {}), noise, rng);
  double square = 0;
  for (int i = 0; i < made.size(); ++i) {
    EXPECT_EQ(noisy.observations(i, 1), made.observations(i, 1));
    square += std::pow(noisy.observations(i, 0) - made.observations(i, 0), 2) / made.size();
    if (i > 0 && !made.timeouts[static_cast<size_t>(i - 1)]) {
      EXPECT_EQ(noisy.observations(i, 0), noisy.next_observations(i - 1, 0));
    }
  }
  EXPECT_NEAR(std::sqrt(square), 0.05, 0.01);
}

TEST(PredictionJudge, EachHorizonIsPredictedAsIfItWereAlone) {
  const Dataset logs = PointMassLogs(kTruth, 20);
  const std::vector<double> other = {1.0, 0.6, 0.5};
  WindowReplayer replayer(PointMassFactory().Make(64, 1), logs);
  const PredictionJudge both(replayer, logs, VectorXd::Constant(2, 1e-6), {2, 10, 10000}, 0.1);
  EXPECT_EQ(both.horizons(), (std::vector<int>{2, 10})) << "no episode lasts 10,000 steps";
  EXPECT_LT(both.n_windows(1), both.n_windows(0)) << "fewer that overlap by no more than half";
  const auto squares = both.Predict(other);
  for (size_t h : {0, 1}) {
    const Judged alone(logs, 1e-6, both.horizons()[h]);
    const VectorXd rms = squares.predicted[h].rowwise().mean().cwiseSqrt();
    EXPECT_NEAR(rms[0], Rms(alone, other)[0], 0.1 * rms[0]);
  }
}

TEST(PredictionJudge, EpisodesTooShortForTheLeadAndAPredictionGiveNoWindow) {
  PointMassOptions brief;
  brief.max_episode_steps = 4;
  const Dataset logs = PointMassLogs(kTruth, 3, brief);
  EXPECT_TRUE(Judged(logs, 1e-6).judge.horizons().empty());
  EXPECT_EQ(Judged(logs, 1e-6).judge.n_windows(), 0);
}

}  // namespace oted::prediction_test
