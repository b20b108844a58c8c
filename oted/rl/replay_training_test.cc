#include "oted/rl/replay_training.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/rl/crossq.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/rl/sac.h"
#include "oted/sim/testing.h"

namespace oted::replay_training_test {

const std::vector<double> kNominal = {1, 1, 0};

SacConfig SmallConfig() {
  SacConfig config;
  config.n_steps = 400;
  config.learning_starts = 100;
  config.eval_interval = 200;
  config.eval_episodes = 3;
  config.n_lanes = 1;
  config.multi_step = 1;
  config.average_over = 1;
  config.batch_size = 32;
  config.hidden = {16, 16};
  config.learning_rate = 3e-4;
  config.normalize_observations = false;
  return config;
}

struct Training {
  const std::filesystem::path folder;
  PointMassOptions options = {};
  SacConfig config = SmallConfig();
  int n_threads = 1;
  EpisodeParameters parameters = [](Rng&) { return kNominal; };
  EvaluationObserver observer = {};
  const std::atomic<bool>* stop = nullptr;
  uint64_t seed = 5;
  std::string algorithm = "sac";
  LogSink* log = nullptr;

  ReplayAgent operator()() const { return In(PointMassFactory(options)); }

  ReplayAgent In(const SimulatorFactory& factory) const {
    NullSink nothing;
    const RunContext context{log != nullptr ? log : &nothing, stop, n_threads};
    DrawnEpisodes source(parameters);
    const AgentJob job = {.factory = factory,
                          .source = source,
                          .eval_parameters = {kNominal},
                          .key = RngKey(seed),
                          .folder = folder,
                          .run_name = "agent",
                          .context = context,
                          .observer = observer};
    if (algorithm == "sac") return TrainAgent(job, config);
    CrossQConfig crossq;
    static_cast<ReplayConfig&>(crossq) = config;
    crossq.critic_hidden = config.hidden;
    crossq.renorm_warmup = 200;
    return TrainAgent(job, crossq);
  }
};

std::string Bytes(const ReplayAgent& result) {
  const auto& p = result.policy.net().parameters();
  return std::string(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(float));
}

/// The buffer's rows after training: s (2), a, s' (2), r, discount.
std::vector<std::array<float, 7>> BufferRows(const std::filesystem::path& folder) {
  const NpzArrays arrays = ReadNpz(folder / "checkpoint.npz");
  const auto& values = std::get<std::vector<float>>(arrays.at("buffer/rows").values);
  std::vector<std::array<float, 7>> rows(values.size() / 7);
  for (size_t i = 0; i < values.size(); ++i) rows[i / 7][i % 7] = values[i];
  return rows;
}

/// The best return from x0 at nominal parameters: straight to zero at full speed.
double OptimalReturn(double x0, int n_steps) {
  double sum = 0;
  for (int t = 1; t <= n_steps; ++t) sum -= std::pow(std::max(std::abs(x0) - 0.1 * t, 0.0), 2);
  return sum;
}

/// What holds for both algorithms.
class EitherAlgorithm : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(TrainByReplay, EitherAlgorithm, testing::Values("sac", "crossq"),
                         [](const auto& algorithm) { return algorithm.param; });

TEST_P(EitherAlgorithm, SolvesThePointMassToNearItsAnalyticOptimum) {
  const TestFolder folder;
  Training run{folder.path()};
  run.algorithm = GetParam();
  run.config.n_steps = 4000;
  run.config.eval_interval = 4000;
  run.config.batch_size = 64;
  run.config.hidden = {32, 32};
  run.config.learning_rate = 2e-3;
  run.config.gamma = 0.95;
  const ReplayAgent result = run();
  const RngKey key(77);
  constexpr int kEpisodes = 50;
  double optimal = 0, idle = 0;
  for (uint64_t k = 0; k < kEpisodes; ++k) {
    Rng rng = key.Index(k).MakeRng();
    const double x0 = rng.Uniform(-1, 1);
    optimal += OptimalReturn(x0, 20) / kEpisodes;
    idle -= 20 * x0 * x0 / kEpisodes;
  }
  const double reached =
      MeanReturn(RunPolicy(PointMassFactory(), result.policy, {.z = {kNominal}, .n_episodes = kEpisodes, .key = key}));
  EXPECT_LE(reached, optimal + 1e-9) << "better than the optimum: the evaluation is wrong";
  EXPECT_GT(reached, optimal + 0.05 * (idle - optimal)) << "optimum " << optimal << ", doing nothing " << idle;
}

TEST_P(EitherAlgorithm, NetworksThatDivergeAreAnErrorThatNamesTheirLearningRate) {
  const TestFolder folder;
  Training run{folder.path()};
  run.algorithm = GetParam();
  run.config.learning_rate = 1e15;
  EXPECT_THAT(MessageOf<DataError>([&] { run(); }),
              testing::AllOf(testing::HasSubstr("the networks of " + GetParam() + " diverged after 10"),
                             testing::HasSubstr("lower " + GetParam() + ".learning_rate (it is 1e+15)")));
}

TEST_P(EitherAlgorithm, AStoppedRunThatGoesOnGivesTheBytesOfAnUninterruptedOne) {
  const TestFolder whole, parts;
  const std::vector<double> other = {0.4, 0.7, 0};
  const EpisodeParameters draw = [&](Rng& rng) { return rng.Uniform() < 0.5 ? kNominal : other; };
  Training uninterrupted{whole.path()};
  uninterrupted.algorithm = GetParam();
  uninterrupted.config.n_steps = 600;
  uninterrupted.config.keep = KeptPolicy::kLast;
  uninterrupted.config.updates_per_step = 0.7;
  uninterrupted.config.multi_step = 3;
  uninterrupted.config.buffer_size = 250;  // the ring has wrapped when the second segment ends
  uninterrupted.parameters = draw;
  const ReplayAgent expected = uninterrupted();

  std::atomic<bool> stop = false;
  int segments = 0;
  Training first{parts.path(), {}, uninterrupted.config, 1, draw, {}, &stop};
  first.algorithm = GetParam();
  first.observer = [&](int64_t, const Policy&, double) {
    ++segments;
    stop = true;
  };
  EXPECT_THROW(first(), Interrupted);
  EXPECT_EQ(segments, 1);
  stop = false;
  EXPECT_THROW(first(), Interrupted);
  EXPECT_EQ(segments, 2);
  Training rest{parts.path(), {}, uninterrupted.config, 1, draw, {}};
  rest.algorithm = GetParam();
  const ReplayAgent resumed = rest();
  EXPECT_EQ(Bytes(resumed), Bytes(expected));
  EXPECT_EQ(resumed.eval_steps, (std::vector<int64_t>{200, 400, 600}));
  EXPECT_EQ(resumed.eval_returns, expected.eval_returns);
  EXPECT_EQ(resumed.eval_return, expected.eval_return);
  // Complete: nothing is trained again.
  EXPECT_EQ(Bytes(rest()), Bytes(expected));
}

TEST(TrainByReplay, TheBestEvaluatedPolicySurvivesAStop) {
  // The case needs a run whose best policy is not its last: with restless learning almost any seed gives one.
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const TestFolder whole, parts;
    Training run{whole.path()};
    run.seed = seed;
    run.config.n_steps = 1000;
    run.config.learning_rate = 3e-2;
    const ReplayAgent expected = run();
    const auto& returns = expected.eval_returns;
    const auto best = std::max_element(returns.begin(), returns.end());
    EXPECT_EQ(expected.eval_return, *best);
    if (best + 1 == returns.end()) continue;
    const int64_t after_best = expected.eval_steps[static_cast<size_t>(best - returns.begin()) + 1];
    std::atomic<bool> stop = false;
    Training parted{parts.path(), {}, run.config};
    parted.seed = seed;
    parted.stop = &stop;
    parted.observer = [&](int64_t step, const Policy&, double) { stop = step == after_best; };
    EXPECT_THROW(parted(), Interrupted);
    stop = false;
    EXPECT_EQ(Bytes(parted()), Bytes(expected));
    return;
  }
  FAIL() << "no seed had its best policy before its last";
}

/// Keeps all that is logged, in order.
class Recorder : public NullSink {
 public:
  void Scalar(std::string_view, std::string_view key, int64_t step, double value) override {
    records.emplace_back(key, step, value);
  }
  std::vector<std::tuple<std::string, int64_t, double>> records;
};

TEST_P(EitherAlgorithm, SameSeedSameBytesAndLogAtAnyNumberOfThreads) {
  for (const int n_lanes : {1, 3}) {
    std::vector<std::string> bytes;
    std::vector<std::vector<std::tuple<std::string, int64_t, double>>> logs;
    for (const int n_threads : {1, 2, 4}) {
      const TestFolder folder;
      Recorder log;
      Training run{folder.path()};
      run.config.n_steps = 600;
      run.config.n_lanes = n_lanes;
      run.n_threads = n_threads;
      run.algorithm = GetParam();
      run.log = &log;
      bytes.push_back(Bytes(run()));
      bytes.back() += ReadFile(folder / "checkpoint.npz");
      logs.push_back(log.records);
    }
    EXPECT_GT(logs[0].size(), 10u);
    for (size_t i : {1, 2}) {
      EXPECT_EQ(bytes[i], bytes[0]) << n_lanes << " lanes";
      EXPECT_EQ(logs[i], logs[0]) << n_lanes << " lanes";
    }
  }
}

/// Segments behind the last checkpoint are made again.
TEST_P(EitherAlgorithm, AKilledRunLosesATwentiethOfItsStepsAtMost) {
  const TestFolder whole, killed;
  constexpr auto skip = std::filesystem::copy_options::skip_existing;
  std::vector<int64_t> saved;
  Training run{whole.path()};
  run.algorithm = GetParam();
  run.config.n_steps = 1600;
  run.config.eval_interval = 10;
  run.observer = [&](int64_t step, const Policy&, double) {
    const std::filesystem::path checkpoint = whole / "checkpoint.npz";
    if (!std::filesystem::exists(checkpoint)) return;
    saved.push_back(CheckpointValues<int64_t>(ReadNpz(checkpoint), "counters", 3)[0]);
    EXPECT_GE(static_cast<double>(saved.back()), 0.95 * static_cast<double>(step - 10)) << step;
    if (step > 1400 && step - saved.back() > 40)
      std::filesystem::copy_file(checkpoint, killed / "checkpoint.npz", skip);
  };
  const std::string expected = Bytes(run());
  EXPECT_LT(std::set(saved.begin(), saved.end()).size(), saved.size() / 2) << "as long as a checkpoint is small alone";
  Training again{killed.path()};
  again.algorithm = GetParam();
  again.config = run.config;
  ASSERT_TRUE(std::filesystem::exists(killed / "checkpoint.npz"));
  EXPECT_EQ(Bytes(again()), expected);
}

/// A run that was killed and not stopped, while an evaluation ran beside it.
TEST_P(EitherAlgorithm, ASegmentWithoutItsEvaluationGetsItLater) {
  const TestFolder folder;
  Training run{folder.path()};
  run.algorithm = GetParam();
  run.config.n_steps = 600;
  const ReplayAgent expected = run();
  const NpzArrays complete = ReadNpz(folder / "checkpoint.npz");
  for (const size_t n_known : {0, 2}) {
    NpzArrays arrays = complete;
    const auto first = [&](const char* name, auto values) {
      values.resize(n_known);
      arrays[name] = NpyArray(values);
    };
    first("eval/steps", expected.eval_steps);
    first("eval/returns", expected.eval_returns);
    if (n_known == 0) arrays["best"] = NpyArray(std::vector<float>{});
    WriteNpz(arrays, folder / "checkpoint.npz");
    const ReplayAgent again = run();
    EXPECT_EQ(again.eval_steps.back(), 600);
    EXPECT_EQ(again.eval_steps.size(), n_known + 1);
    EXPECT_EQ(again.eval_returns.back(), expected.eval_returns.back());
  }
}

/// Point masses whose observations are in other units: 1024 of ours are one of theirs.
class FineUnits : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Fine>(n_lanes, n_threads);
  }

 private:
  class Fine : public PointMass {
   public:
    Fine(int n_lanes, int n_threads) : PointMass({}, n_lanes, n_threads), fine_(static_cast<size_t>(n_lanes)) {}
    std::span<const double> observation(int lane) const override {
      const auto coarse = PointMass::observation(lane);
      fine_[static_cast<size_t>(lane)] = {1024 * coarse[0], 1024 * coarse[1]};
      return fine_[static_cast<size_t>(lane)];
    }

   private:
    mutable std::vector<std::array<double, 2>> fine_;
  };
};

TEST(TrainByReplay, NormalizedObservationsMakeUnitsIrrelevant) {
  // A factor that is a power of two changes no digit of a normalised number: the agents are the same to the last bit.
  for (const bool normalize : {true, false}) {
    const TestFolder coarse, fine;
    Training in_coarse{coarse.path()}, in_fine{fine.path()};
    in_coarse.config.normalize_observations = in_fine.config.normalize_observations = normalize;
    const ReplayAgent a = in_coarse(), b = in_fine.In(FineUnits());
    EXPECT_EQ(Bytes(a) == Bytes(b), normalize);
    EXPECT_EQ(a.eval_returns == b.eval_returns, normalize);
    if (!normalize) continue;
    for (size_t j = 0; j < 2; ++j) {
      EXPECT_NE(a.policy.normalizer().scale[j], 1);
      EXPECT_EQ(1024 * a.policy.normalizer().mean[j], b.policy.normalizer().mean[j]);
      EXPECT_EQ(1024 * a.policy.normalizer().scale[j], b.policy.normalizer().scale[j]);
    }
  }
}

TEST(TrainByReplay, TheKeptPolicyHasTheNormaliserOfItsTime) {
  const TestFolder whole, parts;
  Training run{whole.path()};
  run.config.n_steps = 600;
  run.config.normalize_observations = true;
  std::vector<std::pair<double, double>> seen;  // return, the normaliser's first scale
  run.observer = [&](int64_t, const Policy& policy, double eval_return) {
    seen.emplace_back(eval_return, dynamic_cast<const TanhGaussianPolicy&>(policy).normalizer().scale[0]);
  };
  const ReplayAgent agent = run();
  EXPECT_NE(seen[0].second, seen[1].second);
  EXPECT_EQ(agent.policy.normalizer().scale[0], std::max_element(seen.begin(), seen.end())->second);

  std::atomic<bool> stop = false;
  Training parted{parts.path(), {}, run.config};
  parted.stop = &stop;
  parted.observer = [&](int64_t, const Policy&, double) { stop = true; };
  EXPECT_THROW(parted(), Interrupted);
  stop = false;
  parted.observer = {};
  const ReplayAgent resumed = parted();
  EXPECT_EQ(Bytes(resumed), Bytes(agent));
  EXPECT_EQ(resumed.policy.normalizer().mean, agent.policy.normalizer().mean);
}

TEST(TrainByReplay, SamplesOfDivergedStepsNeverEnterTheBuffer) {
  const TestFolder folder;
  Training run{folder.path(), {.diverge_beyond = 0.8}};
  run.config.n_lanes = 2;
  run();
  const auto rows = BufferRows(folder.path());
  EXPECT_GT(rows.size(), 100u);
  EXPECT_LT(rows.size(), 400u) << "no lane diverged: the case tests nothing";
  for (const auto& row : rows) {
    for (const float v : row) ASSERT_TRUE(std::isfinite(v));
    ASSERT_LE(std::abs(row[3]), 0.8f);
  }
}

TEST(TrainByReplay, OnlyTheTasksOwnEndIsTerminal) {
  for (const int multi_step : {1, 3}) {
    const TestFolder folder;
    Training run{folder.path(), {.terminate_beyond = 0.9, .max_episode_steps = 5}};
    run.config.multi_step = multi_step;
    run.config.n_lanes = 2;
    run();
    const auto rows = BufferRows(folder.path());
    ASSERT_EQ(rows.size(), 400u) << "every step is one row's first";
    int n_terminated = 0;
    std::set<float> discounts;
    for (const auto& row : rows) {
      EXPECT_EQ(row[6] == 0, std::abs(row[3]) > 0.9f);
      n_terminated += row[6] == 0;
      discounts.insert(row[6]);
    }
    EXPECT_GT(n_terminated, 5);
    EXPECT_LT(n_terminated, 60 * multi_step) << "5-step episodes that the clock ends are not terminal";
    std::set<float> powers = {0};
    for (int k = 1; k <= multi_step; ++k) powers.insert(static_cast<float>(std::pow(run.config.gamma, k)));
    EXPECT_EQ(discounts, powers);
  }
}

/// The lengths of training episodes, as they are logged.
class LengthLog : public LogSink {
 public:
  void Scalar(std::string_view, std::string_view key, int64_t, double value) override {
    if (key == "rollout/ep_len_mean") lengths.push_back(value);
  }
  void Progress(std::string_view, std::string_view, int64_t, int64_t, std::string_view) override {}
  void Warning(std::string_view) override {}
  std::vector<double> lengths;
};

TEST_P(EitherAlgorithm, EpisodesGoOnThroughSegmentsAndStops) {
  const TestFolder whole, parts;
  const auto make = [&](const TestFolder& folder, int n_threads) {
    Training run{folder.path()};
    run.algorithm = GetParam();
    run.n_threads = n_threads;
    run.config.n_steps = 560;
    run.config.n_lanes = 2;
    run.config.eval_interval = 28;  // 14 steps of each lane, of 20 in an episode
    run.config.keep = KeptPolicy::kLast;
    run.parameters = [](Rng& rng) { return std::vector<double>{rng.Uniform(0.5, 2.0), 1, 0}; };
    return run;
  };
  LengthLog log;
  Training expected = make(whole, 2);
  expected.log = &log;
  const std::string bytes = Bytes(expected());
  // 14 episodes of either lane in 20 segments: the others have no mean.
  EXPECT_EQ(log.lengths, std::vector<double>(14, 20.0));
  std::atomic<bool> stop = true;
  int n_stops = 0;
  LengthLog log_of_parts;
  for (;; ++n_stops) {
    Training part = make(parts, 1 + n_stops % 2);
    part.log = &log_of_parts;
    part.stop = &stop;
    try {
      EXPECT_EQ(Bytes(part()), bytes);
      break;
    } catch (const Interrupted&) {
    }
  }
  EXPECT_EQ(n_stops, 20) << "at each of the segments";
  EXPECT_EQ(ReadFile(parts / "checkpoint.npz"), ReadFile(whole / "checkpoint.npz"));
  EXPECT_EQ(log_of_parts.lengths, log.lengths);
}

TEST(TrainByReplay, EachEpisodeRunsWithParametersDrawnAnew) {
  const TestFolder folder;
  std::vector<double> drawn;
  Training run{folder.path()};
  run.parameters = [&](Rng& rng) {
    drawn.push_back(rng.Uniform(0.2, 2.0));
    return std::vector<double>{drawn.back(), 1, 0};
  };
  run();
  // 20 episodes of 20 steps, and the one that began after the last.
  const auto rows = BufferRows(folder.path());
  ASSERT_EQ(rows.size(), 400u);
  ASSERT_EQ(drawn.size(), 21u);
  for (size_t i = 0; i < rows.size(); ++i) {
    const double gain = 10 * (static_cast<double>(rows[i][3]) - rows[i][0]) / rows[i][2];
    if (std::abs(rows[i][2]) > 0.1f) {
      EXPECT_NEAR(gain, drawn[i / 20], 1e-4) << i;
    }
  }
}

TEST(TrainByReplay, ActionsInTheBufferAreScaledToTheirRange) {
  const TestFolder folder;
  Training run{folder.path(), {.action_low = -1, .action_high = 3}};
  run();
  double lowest = 1, highest = -1;
  for (const auto& row : BufferRows(folder.path())) {
    EXPECT_NEAR(row[3] - row[0], 0.1 * (1 + 2 * row[2]), 1e-5);  // centre 1, half range 2
    lowest = std::min(lowest, static_cast<double>(row[2]));
    highest = std::max(highest, static_cast<double>(row[2]));
  }
  EXPECT_GE(lowest, -1);
  EXPECT_LE(highest, 1);
  EXPECT_LT(lowest, -0.9);
  EXPECT_GT(highest, 0.9);
}

TEST(TrainByReplay, ADamagedCheckpointIsADataError) {
  const TestFolder folder;
  Training run{folder.path()};
  run();
  const auto damage = [&](const std::function<void(NpzArrays&)>& change) {
    NpzArrays arrays = ReadNpz(folder / "checkpoint.npz");
    NpzArrays changed = arrays;
    change(changed);
    WriteNpz(changed, folder / "checkpoint.npz");
    MessageOf<DataError>([&] { run(); });
    WriteNpz(arrays, folder / "checkpoint.npz");
  };
  for (const auto& [name, array] : ReadNpz(folder / "checkpoint.npz")) {
    SCOPED_TRACE(name);
    damage([&, key = name](NpzArrays& arrays) { arrays.erase(key); });
    damage([&, key = name](NpzArrays& arrays) { arrays[key] = NpyArray(std::vector<uint8_t>{7, 7, 7}); });
  }
}

/// Simulators whose physics breaks down at once where the first evaluation runs: its return, 0, is the best there is.
class BrokenInTheFirstEvaluation : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    const bool broken = n_lanes == SmallConfig().eval_episodes && n_evaluations_++ == 0;
    return std::make_unique<PointMass>(PointMassOptions{.diverge_beyond = broken ? 0.0 : INFINITY}, n_lanes, n_threads);
  }

 private:
  mutable int n_evaluations_ = 0;
};

TEST(TrainByReplay, AnEvaluationInWhichEveryEpisodeDivergedIsNotTheBest) {
  const TestFolder folder;
  NullSink log;
  DrawnEpisodes source([](Rng&) { return kNominal; });
  const ReplayAgent result = TrainAgent({.factory = BrokenInTheFirstEvaluation(),
                                         .source = source,
                                         .eval_parameters = {kNominal},
                                         .key = RngKey(5),
                                         .folder = folder.path(),
                                         .run_name = "agent",
                                         .context = {&log, nullptr, 1}},
                                        SmallConfig());
  ASSERT_EQ(result.eval_returns.size(), 2u);
  ASSERT_EQ(result.eval_returns[0], 0);
  ASSERT_LT(result.eval_returns[1], 0);
  EXPECT_EQ(result.eval_return, result.eval_returns[1]);
  EXPECT_EQ(result.n_diverged, 0);
}

}  // namespace oted::replay_training_test
