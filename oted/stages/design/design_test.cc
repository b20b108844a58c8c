#include "oted/stages/design/design.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/matching/verdict.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/testing.h"

namespace oted::design_test {

const std::vector<double> kTruth = {1.5, 0.6, 0.5};
constexpr size_t kGain = 0, kDamping = 1, kIdle = 2;

DesignConfig SmallConfig() {
  DesignConfig config = DesignConfig::For(DesignMethod::kTransitions);
  config.adversarial.n_sims = 24;
  config.adversarial.n_steps = 40;
  config.adversarial.n_iterations = 60;
  config.discriminator.hidden = {48, 48};
  config.discriminator.learning_rate = 1e-3;
  config.discriminator.steps = 40;
  config.discriminator.batch = 128;
  return config;
}

/// Asks for a stop when iteration `at` has been reported.
class StopAt : public NullSink {
 public:
  explicit StopAt(int64_t at) : at_(at) {}
  void Progress(std::string_view, std::string_view, int64_t done, int64_t, std::string_view) override {
    if (done == at_) stop = true;
  }
  std::atomic<bool> stop{false};

 private:
  int64_t at_;
};

DesignResult Learn(const DesignConfig& config, const std::filesystem::path& folder, int n_threads = 1,
                   const SimulatorFactory& factory = PointMassFactory(), const Dataset& logs = PointMassLogs(kTruth, 8),
                   uint64_t seed = 1) {
  NullSink log;
  RunContext context{.log = &log, .n_threads = n_threads};
  return LearnDesign({factory, logs, nullptr, RngKey(seed), folder, "design/test/1", context}, config);
}

TEST(PredictKeptAside, OfNoisyLogsTheDesignPredictsBetterThanTheNominalSimulatorAndReachesTheFloor) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 40), 0.05, RngKey(4));
  const PointMassFactory factory;
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 1};
  const TestFolder folder;
  for (const DesignMethod method : {DesignMethod::kTrajectories, DesignMethod::kLeastSquares}) {
    const DesignProblem problem{factory, logs, nullptr, RngKey(1), folder / "design", "design/test/1", context};
    const DesignResult result = LearnDesign(problem, DesignConfig::For(method));
    const std::optional<HeldOutPrediction> prediction = PredictKeptAside(problem, result.q, result.fit);
    ASSERT_TRUE(prediction);
    EXPECT_EQ(prediction->horizons[0].learned, method == DesignMethod::kLeastSquares) << "which keeps nothing aside";
    EXPECT_TRUE(PredictsBetter(*prediction));
    EXPECT_TRUE(ReachesFloor(*prediction));
  }
}

TEST(PredictKeptAside, NeedsNoMoreThanPositions) {
  PositionAlone target(40, 1);
  const Dataset logs = WithSensorNoise(RandomLogs(target, kTruth), 0.02, RngKey(4));
  const PositionAloneFactory factory;
  ASSERT_FALSE(factory.spec().can_set_state);
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 1};
  const TestFolder folder;
  const DesignProblem problem{factory, logs, nullptr, RngKey(1), folder / "design", "design/test/1", context};
  const DesignResult result = LearnDesign(problem, DesignConfig::For(DesignMethod::kTrajectories));
  const std::optional<HeldOutPrediction> prediction = PredictKeptAside(problem, result.q, result.fit);
  ASSERT_TRUE(prediction);
  EXPECT_TRUE(PredictsBetter(*prediction));
}

void ExpectSameBits(const DesignResult& a, const DesignResult& b) {
  EXPECT_EQ(a.q.mean(), b.q.mean());
  EXPECT_EQ(a.q.log_std(), b.q.log_std());
  EXPECT_EQ(a.learning_progress, b.learning_progress);
  NpzArrays g_a, g_b;
  if (a.g) a.g->Save(g_a);
  if (b.g) b.g->Save(g_b);
  ASSERT_EQ(g_a.size(), g_b.size());
  for (const auto& [name, array] : g_a) EXPECT_EQ(array.values, g_b.at(name).values) << name;
}

TEST(LearnDesign, RecoversWhatTheLogsShowAndStaysWideWhereTheyShowNothing) {
  const TestFolder folder;
  const DesignResult design = Learn(SmallConfig(), folder.path());
  const std::vector<double> mode = design.q.Mode(), std = design.q.Std();
  EXPECT_NEAR(mode[kGain], kTruth[kGain], 0.1);
  EXPECT_NEAR(mode[kDamping], kTruth[kDamping], 0.05);
  // In units of the uniform distribution's spread.
  EXPECT_LT(std[kGain], 0.25 * 1.8 / std::sqrt(12.0));
  EXPECT_LT(std[kDamping], 0.25 * 0.8 / std::sqrt(12.0));
  EXPECT_GT(std[kIdle], 0.6 * 1.0 / std::sqrt(12.0)) << "no effect: nothing to learn";
}

// The nominal damping, 1, is its upper bound too; least squares that start on a bound can stall there.
TEST(LearnDesign, ATruthOnABoundIsApproachedAndANominalValueOnABoundHoldsNothingBack) {
  const TestFolder folder;
  const DesignResult design =
      Learn(SmallConfig(), folder.path(), 1, PointMassFactory(), PointMassLogs({2.0, 0.25, 0.5}, 8));
  const std::vector<double> mode = design.q.Mode();
  EXPECT_NEAR(mode[kGain], 2.0, 0.1);
  EXPECT_NEAR(mode[kDamping], 0.25, 0.05);
}

TEST(LearnDesign, GivesTheSameBitsAtAnyNumberOfThreads) {
  const TestFolder one, two;
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 12;
  ExpectSameBits(Learn(config, one.path(), 1), Learn(config, two.path(), 2));
}

TEST(LearnDesign, AnotherSeedIsAnotherDesign) {
  const TestFolder one, two;
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 3;
  const PointMassFactory factory;
  const Dataset logs = PointMassLogs(kTruth, 4);
  EXPECT_NE(Learn(config, one.path(), 1, factory, logs, 1).q.mean(),
            Learn(config, two.path(), 1, factory, logs, 2).q.mean());
}

TEST(LearnDesign, AStoppedDesignGoesOnAsIfItHadNot) {
  const TestFolder whole_folder, stopped_folder;
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 24;
  const DesignResult whole = Learn(config, whole_folder.path());
  // Before and after the replay is full, and twice in one design.
  for (const int64_t at : {7, 17}) {
    StopAt log(at);
    const RunContext context{.log = &log, .stop = &log.stop};
    EXPECT_THROW(LearnDesign({PointMassFactory(), PointMassLogs(kTruth, 8), nullptr, RngKey(1), stopped_folder.path(),
                              "design/test/1", context},
                             config),
                 Interrupted);
    EXPECT_TRUE(std::filesystem::exists(stopped_folder / "checkpoint.npz"));
  }
  ExpectSameBits(Learn(config, stopped_folder.path()), whole);
}

/// a = tanh(slope x + 0.2 noise), as a policy.
TanhGaussianPolicy LinearClone(double slope) {
  TanhGaussianPolicy clone({{0.0, 0.0}, {1.0, 1.0}}, {}, {-1.0}, {1.0});
  auto& p = clone.net().parameters();
  p[0] = static_cast<float>(slope);  // (in, out) = (x, mean)
  p[5] = std::log(0.2f);
  return clone;
}

/// Of such a policy with slope -1.
Dataset LinearLogs(const std::vector<double>& z) {
  PointMass simulator({}, 8, 1);
  const TanhGaussianPolicy expert = LinearClone(-1);
  const auto actor = expert.MakeActor(ActionNoise::kSampled);
  Rng rng(5);
  EpisodeRecorder recorder(8);
  const auto act = [&](std::span<const double> s, int n, std::span<double> a) { actor->Act(s, n, rng, a); };
  RunEpisodes(simulator, std::vector(8, z), act, RngKey(5), recorder.Observer());
  return recorder.Logs();
}

DesignConfig JointConfig() {
  DesignConfig config = DesignConfig::For(DesignMethod::kPaper);
  config.adversarial.horizon = config.adversarial.n_steps = 20;
  config.adversarial.n_sims = 8;
  config.adversarial.n_iterations = 12;
  config.discriminator.hidden = {16};
  config.discriminator.steps = 5;
  config.discriminator.batch = 32;
  config.adversarial.clone_updates = 6;
  config.adversarial.clone_rate = 1e-2;
  return config;
}

DesignResult LearnJointly(const DesignConfig& config, const std::filesystem::path& folder, LogSink* log,
                          const std::atomic<bool>* stop = nullptr, int n_threads = 1) {
  const TanhGaussianPolicy clone = LinearClone(0);
  const RunContext context{.log = log, .stop = stop, .n_threads = n_threads};
  return LearnDesign(
      {PointMassFactory(), LinearLogs({1.0, 0.6, 0.5}), &clone, RngKey(1), folder, "design/test/1", context}, config);
}

TEST(LearnDesign, JointTrainingBringsAWrongCloneTowardsTheLogs) {
  NullSink log;
  const TestFolder folder, without;
  const DesignResult joint = LearnJointly(JointConfig(), folder.path(), &log);
  ASSERT_TRUE(joint.clone);
  const float slope = joint.clone->net().parameters()[0];
  EXPECT_LT(slope, -0.1) << "from 0 towards -1";
  EXPECT_GT(slope, -1.2);
  DesignConfig config = JointConfig();
  config.adversarial.clone_updates = 0;
  EXPECT_FALSE(LearnJointly(config, without.path(), &log).clone);
}

TEST(LearnDesign, JointTrainingGoesOnAfterAStopAndAtAnyNumberOfThreadsWithTheSameBits) {
  const TestFolder whole_folder, stopped_folder, threads_folder;
  NullSink log;
  const DesignResult whole = LearnJointly(JointConfig(), whole_folder.path(), &log);
  StopAt stop_at(6);
  EXPECT_THROW(LearnJointly(JointConfig(), stopped_folder.path(), &stop_at, &stop_at.stop), Interrupted);
  const DesignResult gone_on = LearnJointly(JointConfig(), stopped_folder.path(), &log);
  ExpectSameBits(gone_on, whole);
  EXPECT_EQ(gone_on.clone->net().parameters(), whole.clone->net().parameters());
  const DesignResult threads = LearnJointly(JointConfig(), threads_folder.path(), &log, nullptr, 2);
  ExpectSameBits(threads, whole);
  EXPECT_EQ(threads.clone->net().parameters(), whole.clone->net().parameters());
}

TEST(LearnDesign, MethodsThatReplayTheLogFindTheTruthAndBeginAnewWhenStopped) {
  for (const DesignMethod method : {DesignMethod::kTrajectories, DesignMethod::kLeastSquares, DesignMethod::kDropo}) {
    SCOPED_TRACE(Describe(method).name);
    const TestFolder whole_folder, stopped_folder;
    DesignConfig config = SmallConfig();
    config.method = method;
    config.discriminator.steps = 5;
    config.trajectories.coarse = 8;
    config.dropo.budget = 300;
    const DesignResult whole = Learn(config, whole_folder.path());
    EXPECT_NEAR(whole.q.Mode()[kGain], kTruth[kGain], 0.1);
    EXPECT_NEAR(whole.q.Mode()[kDamping], kTruth[kDamping], 0.1);
    StopAt log(2);
    const RunContext context{.log = &log, .stop = &log.stop};
    EXPECT_THROW(LearnDesign({PointMassFactory(), PointMassLogs(kTruth, 8), nullptr, RngKey(1), stopped_folder.path(),
                              "design/test/1", context},
                             config),
                 Interrupted);
    ExpectSameBits(Learn(config, stopped_folder.path()), whole);
  }
}

/// A point mass whose third parameter does nothing, but breaks the physics above (or below) 0.5.
class Breaking : public PointMass {
 public:
  Breaking(bool above, bool below, int n_lanes, int n_threads)
      : PointMass({}, n_lanes, n_threads), above_(above), below_(below), idle_(static_cast<size_t>(n_lanes)) {}
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, z);
    idle_[static_cast<size_t>(lane)] = z[2];
  }
  LaneStatus status(int lane) const override {
    const bool broken = idle_[static_cast<size_t>(lane)] > 0.5 ? above_ : below_;
    return broken ? LaneStatus::kDiverged : PointMass::status(lane);
  }

 private:
  bool above_, below_;
  std::vector<double> idle_;
};

class BreakingFactory : public PointMassFactory {
 public:
  BreakingFactory(bool above, bool below) : above_(above), below_(below) {}
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Breaking>(above_, below_, n_lanes, n_threads);
  }

 private:
  bool above_, below_;
};

TEST(LearnDesign, ByTrajectoriesWhatTheLogsDoNotShowStaysByItsNominalValue) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 10), 0.02, RngKey(4));
  const TestFolder folder;
  const DesignResult result =
      Learn(DesignConfig::For(DesignMethod::kTrajectories), folder / "d", 1, PointMassFactory(), logs);
  EXPECT_GT(result.q.Mode()[kIdle], 0.8) << "nominal: 1, the upper bound";
  EXPECT_GT(result.q.Std()[kIdle], 0.5 / std::sqrt(12.0)) << "and nothing was learned of it";
  EXPECT_NEAR(result.q.Mode()[kGain], kTruth[kGain], 0.1);
}

TEST(LearnDesign, LeavesTheRegionWhereThePhysicsBreaks) {
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 30;
  const TestFolder above, below;
  const auto breaks_above = Learn(config, above.path(), 1, BreakingFactory(true, false));
  const auto breaks_below = Learn(config, below.path(), 1, BreakingFactory(false, true));
  EXPECT_LT(breaks_above.q.Mode()[kIdle], 0.35);
  EXPECT_GT(breaks_below.q.Mode()[kIdle], 0.65);
}

TEST(LearnDesign, LambdaHoldsQAtThePrior) {
  DesignConfig free = SmallConfig(), held = SmallConfig();
  free.adversarial.n_iterations = held.adversarial.n_iterations = 25;
  free.adversarial.lambda = 0;
  held.adversarial.lambda = 1;
  const TestFolder one, two;
  const double kl_free = Learn(free, one.path()).q.KlToPrior(), kl_held = Learn(held, two.path()).q.KlToPrior();
  EXPECT_GT(kl_free, 1.0) << "the logs teach something";
  EXPECT_LT(kl_held, 0.5 * kl_free);
}

TEST(LearnDesign, LearningProgressIsOfOneKindWhateverTheReward) {
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 1;
  const TestFolder one, two;
  const double progress = Learn(config, one.path()).learning_progress.value();
  EXPECT_NEAR(progress, std::log(2.0), 0.15) << "g is blind: -log(1 - g) is log 2";
  config.adversarial.reward = DesignReward::kLogRatio;
  EXPECT_DOUBLE_EQ(Learn(config, two.path()).learning_progress.value(), progress);
}

TEST(LearnDesign, LogsItsCurvesUnderTheDocumentedNames) {
  class Curves : public NullSink {
   public:
    void Scalar(std::string_view run, std::string_view key, int64_t step, double value) override {
      EXPECT_EQ(run, "design/test/1");
      EXPECT_TRUE(std::isfinite(value)) << key;
      steps[std::string(key)].push_back(step);
    }
    std::map<std::string, std::vector<int64_t>> steps;
  } curves;
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 3;
  const TestFolder folder;
  const RunContext context{.log = &curves};
  LearnDesign(
      {PointMassFactory(), PointMassLogs(kTruth, 4), nullptr, RngKey(1), folder.path(), "design/test/1", context},
      config);
  for (const char* key : {"design/reward", "design/kl", "design/discriminator_loss", "design/discriminator_accuracy",
                          "design/mode/gain", "design/std/gain", "design/mode/idle"}) {
    EXPECT_THAT(curves.steps[key], testing::ElementsAre(1, 2, 3)) << key;
  }
}

TEST(LearnDesign, WherePhysicsAlwaysBreaksNothingIsLearned) {
  DesignConfig config = SmallConfig();
  config.adversarial.n_iterations = 5;
  config.adversarial.lambda = 0;
  const TestFolder folder;
  const auto design = Learn(config, folder.path(), 1, BreakingFactory(true, true));
  EXPECT_THAT(design.q.mean(), testing::Each(0.0));
  EXPECT_THAT(design.q.log_std(), testing::Each(testing::DoubleEq(std::log(config.adversarial.initial_std))));
}

TEST(LearnDesign, RefusesDataOfAnotherTaskAndContradictingSettings) {
  const TestFolder folder;
  Dataset wrong = PointMassLogs(kTruth, 2);
  Array2<double> wide(wrong.size(), 3);
  wrong.observations = wrong.next_observations = wide;
  EXPECT_THAT(MessageOf<DataError>([&] { Learn(SmallConfig(), folder.path(), 1, PointMassFactory(), wrong); }),
              testing::HasSubstr("task 'PointMass'"));
  DesignConfig config = SmallConfig();
  config.adversarial.starts = RolloutStarts::kInitial;
  EXPECT_THROW(Learn(config, folder.path()), UsageError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace oted::design_test
