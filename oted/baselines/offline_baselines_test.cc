#include "oted/baselines/offline_baselines.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"

namespace oted::offline_baselines_test {

const std::vector<double> kNominal = {1, 1, 0};

/// Small networks, few steps.
OfflineSettings Small() {
  OfflineSettings settings;
  settings.td3_bc.n_steps = 2000;
  settings.td3_bc.batch_size = 64;
  settings.td3_bc.learning_rate = 1e-3;
  settings.td3_bc.hidden = settings.rebrac.hidden = settings.mbop.hidden = {32, 32};
  settings.rebrac.n_steps = 2000;
  settings.rebrac.batch_size = 64;
  settings.f_brc.behavior_steps = 500;
  settings.f_brc.behavior_hidden = {32};
  settings.f_brc.hidden = {32, 32};
  settings.f_brc.n_steps = 2000;
  settings.f_brc.batch_size = 64;
  settings.f_brc.learning_rate = 1e-3;
  settings.f_brc.reward_bonus = 0;
  settings.mbop.n_steps = 600;
  settings.mbop.batch_size = 64;
  settings.mbop.members = 2;
  settings.mbop.horizon = 4;
  settings.mbop.trajectories = 100;
  settings.mbop.noise = 0.5;
  settings.mbop.sharpness = 20;
  return settings;
}

std::unique_ptr<const Policy> Learn(const OfflineEntry& entry, const Dataset& logs, const SimulatorSpec& spec,
                                    const OfflineSettings& settings, const RunContext& context,
                                    const std::filesystem::path& folder) {
  const OfflineJob job{logs, spec, RngKey(5), folder, entry.name, context};
  return LearnOffline(*entry.make(job, settings), job).policy;
}

std::unique_ptr<const Policy> Learn(OfflineBaseline baseline, const Dataset& logs, const SimulatorSpec& spec,
                                    const OfflineSettings& settings) {
  const TestFolder folder;
  NullSink log;
  return Learn(EntryOf(baseline), logs, spec, settings, {&log, nullptr, 1}, folder.path());
}

/// One decision, then the end: in state x, action a earns 5 - 10 (a - x/2)^2. Logged actions are uniform in [-1, 1].
Dataset Decisions() {
  Dataset logs;
  Rng rng(3);
  for (int i = 0; i < 3000; ++i) {
    const std::vector<double> s = {rng.Uniform(-1, 1), 0}, a = {rng.Uniform(-1, 1)};
    logs.observations.AppendRow(s);
    logs.next_observations.AppendRow(s);
    logs.actions.AppendRow(a);
    logs.rewards.push_back(5 - 10 * std::pow(a[0] - 0.5 * s[0], 2));
    logs.terminals.push_back(1);
    logs.timeouts.push_back(0);
  }
  return logs;
}

/// The slope and the offset of a policy's mean action over x.
std::pair<double, double> LineOf(const Policy& policy) {
  const BatchPolicy act = MeanActionPolicy(policy);
  double sum = 0, product = 0, square = 0;
  for (int i = -8; i <= 8; ++i) {
    const std::vector<double> s = {0.1 * i, 0};
    std::vector<double> a(1);
    act(s, 1, a);
    sum += a[0] / 17;
    product += a[0] * s[0];
    square += s[0] * s[0];
  }
  return {product / square, sum};
}

TEST(OfflineBaselines, TD3BCAndReBRACWeighValueAgainstTheLogsAsTheirLossSays) {
  const SimulatorSpec spec = PointMass::MakeSpec({});
  const Dataset logs = Decisions();
  // The logged action's mean is 0: minimising  w a^2 - lambda Q  gives a = m x with  m = l / (l + w) / 2, l = 10
  // lambda, and lambda = v / mean |Q| with  mean |Q| = 5 - 10 (m - 1/2)^2 / 3.
  const auto slope = [](double value_weight, double penalty) {
    double m = 0;
    for (int i = 0; i < 50; ++i) {
      const double l = 10 * value_weight / (5 - 10 * (m - 0.5) * (m - 0.5) / 3);
      m = 0.5 * l / (l + penalty);
    }
    return m;
  };
  OfflineSettings settings = Small();
  settings.td3_bc.alpha = 0.6;
  const auto td3_bc = LineOf(*Learn(OfflineBaseline::kTd3Bc, logs, spec, settings));
  EXPECT_NEAR(td3_bc.first, slope(0.6, 1), 0.05);
  EXPECT_NEAR(td3_bc.second, 0, 0.03);
  settings.rebrac.actor_penalty = 2;
  const auto rebrac = LineOf(*Learn(OfflineBaseline::kRebrac, logs, spec, settings));
  EXPECT_NEAR(rebrac.first, slope(1, 2), 0.05);
  EXPECT_NEAR(rebrac.second, 0, 0.03);
}

TEST(OfflineBaselines, FBRCFindsTheBestDecision) {
  const auto line = LineOf(*Learn(OfflineBaseline::kFisherBrc, Decisions(), PointMass::MakeSpec({}), Small()));
  EXPECT_NEAR(line.first, 0.5, 0.1);
  EXPECT_NEAR(line.second, 0, 0.1);
}

/// Episodes of uniformly random actions.
const Dataset& RandomLogs() {
  static const Dataset logs = [] {
    const PointMassFactory factory;
    Dataset all;
    for (uint64_t batch = 0; batch < 20; ++batch) {
      EpisodeRecorder recorder(8, LogPrecision::kDouble, true);
      const auto simulator = factory.Make(8, 1);
      Rng rng = RngKey(1).Index(batch).MakeRng();
      RunEpisodes(*simulator, std::vector(8, kNominal), UniformRandomPolicy(factory.spec(), rng),
                  RngKey(2).Index(batch), recorder.Observer());
      all.Append(recorder.Logs());
    }
    return all;
  }();
  return logs;
}

double ReturnOf(const BatchPolicy& policy) {
  return EvaluateBatchPolicy(PointMassFactory(), policy, kNominal, 40, 1, RngKey(9)).mean_return;
}

TEST(OfflineBaselines, EachLearnsTheOptimumOfAPointMassFromRandomActions) {
  const BatchPolicy best = [](std::span<const double> observations, int n, std::span<double> actions) {
    for (int i = 0; i < n; ++i) {
      actions[static_cast<size_t>(i)] = std::clamp(-10 * observations[static_cast<size_t>(2 * i)], -1.0, 1.0);
    }
  };
  Rng rng(4);
  const double optimum = ReturnOf(best), random = ReturnOf(UniformRandomPolicy(PointMass::MakeSpec({}), rng));
  ASSERT_GT(optimum - random, 1);
  for (const OfflineEntry& entry : OfflineBaselines()) {
    const auto policy = Learn(entry.baseline, RandomLogs(), PointMass::MakeSpec({}), Small());
    const double share = (ReturnOf(MeanActionPolicy(*policy)) - random) / (optimum - random);
    EXPECT_GT(share, 0.8) << entry.name;
    EXPECT_LE(share, 1.0001) << entry.name << ": better than the optimum";
  }
}

/// Stops a run at a step.
class StopAt : public NullSink {
 public:
  void Progress(std::string_view, std::string_view, int64_t done, int64_t, std::string_view) override {
    if (done >= at) stop = true;
  }
  int64_t at = 0;
  std::atomic<bool> stop{false};
};

TEST(OfflineBaselines, AStoppedOneGoesOnToTheSameBytesAtAnyNumberOfThreads) {
  OfflineSettings settings = Small();
  settings.td3_bc.n_steps = settings.rebrac.n_steps = settings.mbop.n_steps = 120;
  settings.f_brc.behavior_steps = settings.f_brc.n_steps = 80;
  settings.f_brc.check_interval = 20;
  const SimulatorSpec spec = PointMass::MakeSpec({});
  for (const OfflineEntry& entry : OfflineBaselines()) {
    const TestFolder folder, whole;
    NullSink log;
    Learn(entry, RandomLogs(), spec, settings, {&log, nullptr, 1}, whole.path())->Save(whole / "policy.npz");
    for (const int64_t at : {50, 100}) {
      StopAt sink;
      sink.at = at;
      EXPECT_THROW(Learn(entry, RandomLogs(), spec, settings, {&sink, &sink.stop, 3}, folder.path()), Interrupted);
    }
    Learn(entry, RandomLogs(), spec, settings, {&log, nullptr, 3}, folder.path())->Save(folder / "policy.npz");
    EXPECT_EQ(ReadFile(folder / "policy.npz"), ReadFile(whole / "policy.npz")) << entry.name;
  }
}

TEST(OfflineBaselines, OneThatDivergesIsADataErrorWithTheRemedy) {
  OfflineSettings settings = Small();
  settings.mbop.learning_rate = 1e30;
  EXPECT_NE(MessageOf<DataError>([&] {
              Learn(OfflineBaseline::kMbop, RandomLogs(), PointMass::MakeSpec({}), settings);
            }).find("lower its learning_rate"),
            std::string::npos);
}

TEST(OfflineBaselines, LogsThatTheyCannotLearnFromAreRefusedWithTheRemedy) {
  const SimulatorSpec spec = PointMass::MakeSpec({});
  Dataset logs = RandomLogs();
  OfflineSettings settings = Small();
  settings.mbop.horizon = 21;
  EXPECT_NE(MessageOf<DataError>([&] {
              CheckOffline(EntryOf(OfflineBaseline::kMbop), settings, logs, spec);
            }).find("longest episode has 20 transitions, mbop.horizon is 21; lower it"),
            std::string::npos);
  logs.rewards.clear();
  for (const OfflineEntry& entry : OfflineBaselines()) {
    EXPECT_NE(MessageOf<DataError>([&] { CheckOffline(entry, Small(), logs, spec); }).find("no rewards"),
              std::string::npos);
  }
  SimulatorSpec discrete = spec;
  discrete.n_discrete_actions = 3;
  EXPECT_NE(MessageOf<UsageError>([&] {
              CheckOffline(EntryOf(OfflineBaseline::kTd3Bc), Small(), RandomLogs(), discrete);
            }).find("discrete actions"),
            std::string::npos);
}

}  // namespace oted::offline_baselines_test
