#include "oted/rl/starts.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/rl/sac.h"
#include "oted/sim/testing.h"

namespace oted::starts_test {

const std::vector<double> kNominal = {1, 1, 0};
constexpr int kEpisodes = 4;

/// Pushes the point mass with one constant force, which it draws at its start. It never learns.
class ConstantLearner : public Learner {
 public:
  explicit ConstantLearner(RngKey key) : force_(static_cast<float>(key.MakeRng().Uniform(-1, 1))) {}
  int64_t n_steps() const override { return n_steps_; }
  std::vector<float> PolicyParameters() const override { return {force_}; }
  std::unique_ptr<Policy> MakePolicy(std::span<const float> parameters) const override {
    auto policy = std::make_unique<TanhGaussianPolicy>(Normalizer{{0, 0}, {1, 1}}, std::vector<int>{},
                                                       std::vector{-1.0}, std::vector{1.0});
    auto& net = policy->net().parameters();
    std::fill(net.begin(), net.end(), 0.0f);
    net[net.size() - 2] = parameters[0];  // the bias of the mean
    return policy;
  }
  void RunSegment(int64_t end, const std::function<void()>&) override { n_steps_ = end; }
  const EpisodeStatistics& episodes() const override { return episodes_; }
  std::vector<std::pair<std::string, double>> Losses() const override { return {}; }
  void Save(NpzArrays& arrays) override {
    arrays["force"] = NpyArray(std::vector<float>{force_});
    arrays["n"] = NpyArray(std::vector<int64_t>{n_steps_});
  }
  void Restore(const NpzArrays& arrays) override {
    force_ = CheckpointValues<float>(arrays, "force", 1)[0];
    n_steps_ = CheckpointValues<int64_t>(arrays, "n", 1)[0];
  }

 private:
  float force_;
  int64_t n_steps_ = 0;
  EpisodeStatistics episodes_{1};
};

TEST(ChooseStart, TheOneWithTheHighestReturnGoesOn) {
  const TestFolder folder;
  NullSink log;
  PointMassFactory factory;
  DrawnEpisodes source([](Rng&) { return kNominal; });
  const RngKey key(3);
  double best = -INFINITY;
  std::set<double> returns;
  for (uint64_t k = 0; k < 5; ++k) {
    const ConstantLearner learner(key.Stage("start").Index(k));
    const double value =
        MeanReturn(RunPolicy(factory, *learner.MakePolicy(learner.PolicyParameters()),
                             {.z = {kNominal}, .n_episodes = kEpisodes, .key = key.Stage("evaluation")}));
    best = std::max(best, value);
    returns.insert(value);
  }
  ASSERT_EQ(returns.size(), 5u) << "starts that are alike test nothing";
  std::vector<std::pair<int64_t, double>> seen;
  const AgentJob job = {.factory = factory,
                        .source = source,
                        .eval_parameters = {kNominal},
                        .key = key,
                        .folder = folder.path(),
                        .run_name = "agent",
                        .context = {&log, nullptr, 2},
                        .observer = [&](int64_t step, const Policy&, double value) { seen.emplace_back(step, value); }};
  const TrainingSchedule schedule = {1000, 100, kEpisodes, KeptPolicy::kBest};
  const auto make = [](EpisodeSource&, RngKey of, int) { return std::make_unique<ConstantLearner>(of); };
  ChooseStart(job, schedule, {5, 300}, make);
  ConstantLearner learner(key);
  const LearningCurve curve = TrainInSegments(learner, job, schedule);
  EXPECT_EQ(curve.eval_steps, (std::vector<int64_t>{300, 400, 500, 600, 700, 800, 900, 1000}));
  for (const double value : curve.eval_returns) EXPECT_EQ(value, best);
  ASSERT_EQ(seen.size(), 8u) << "the chosen start's evaluation is seen once";
  EXPECT_EQ(seen[0], std::pair(int64_t{300}, best));
  EXPECT_FALSE(std::filesystem::exists(folder / "starts"));
}

/// Episodes that grow longer to the right: each is told, and moves where the next begins.
class Curriculum : public EpisodeSource {
 public:
  std::unique_ptr<EpisodeSource> Clone() const override { return std::make_unique<Curriculum>(*this); }
  std::vector<double> Draw(int, Rng&) override { return {gain_, 1, 0}; }
  void EpisodeEnded(int, double, bool) override { gain_ = std::min(2.0, gain_ + 0.01); }
  void Save(NpzArrays& arrays) const override { arrays["gain"] = NpyArray(std::vector<double>{gain_}); }
  void Restore(const NpzArrays& arrays) override { gain_ = CheckpointValues<double>(arrays, "gain", 1)[0]; }
  double gain() const { return gain_; }

 private:
  double gain_ = 0.5;
};

struct Training {
  const std::filesystem::path folder;
  int n_threads = 1;
  const std::atomic<bool>* stop = nullptr;
  EvaluationObserver observer = {};
  LogSink* log = nullptr;

  /// The policy's bytes, the checkpoint's, and where the curriculum came to.
  std::pair<std::string, double> operator()() const {
    NullSink nothing;
    Curriculum source;
    SacConfig config;
    config.n_steps = 600;
    config.n_lanes = 2;
    config.learning_starts = 100;
    config.eval_interval = 200;
    config.batch_size = 16;
    config.hidden = {8};
    config.n_starts = 3;
    config.start_steps = 200;
    config.average_over = 50;
    const ReplayAgent agent = TrainAgent({.factory = PointMassFactory(),
                                          .source = source,
                                          .eval_parameters = {kNominal},
                                          .key = RngKey(5),
                                          .folder = folder,
                                          .run_name = "agent",
                                          .context = {log != nullptr ? log : &nothing, stop, n_threads},
                                          .observer = observer},
                                         config);
    const auto& p = agent.policy.net().parameters();
    return {std::string(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(float)) +
                ReadFile(folder / "checkpoint.npz"),
            source.gain()};
  }
};

/// Keeps what a progress bar would show.
class ProgressRecord : public LogSink {
 public:
  void Scalar(std::string_view, std::string_view, int64_t, double) override {}
  void Progress(std::string_view, std::string_view label, int64_t done, int64_t total, std::string_view) override {
    labels.insert(std::string(label));
    shown.emplace_back(done, total);
  }
  void Warning(std::string_view) override {}
  std::set<std::string> labels;
  std::vector<std::pair<int64_t, int64_t>> shown;
};

TEST(ChooseStart, ProgressIsOfOneAgentAndNeverGoesBack) {
  const TestFolder folder;
  ProgressRecord log;
  Training{folder.path(), 1, nullptr, {}, &log}();
  EXPECT_EQ(log.labels, std::set<std::string>{"agent"});
  EXPECT_TRUE(std::ranges::is_sorted(log.shown));
  for (const auto& [unused, total] : log.shown) EXPECT_EQ(total, 3 * 200 + 400);
  EXPECT_EQ(log.shown.back().first, 3 * 200 + 400);
}

TEST(ChooseStart, SameBytesAtAnyNumberOfThreadsAndAfterAStop) {
  const TestFolder whole;
  const auto [expected, gain] = Training{whole.path()}();
  // 30 episodes of 20 steps: one start's 10 and the 20 that follow, of one agent.
  EXPECT_NEAR(gain, 0.5 + 0.01 * 30, 1e-9);
  for (const int n_threads : {2, 4}) {
    const TestFolder folder;
    EXPECT_EQ((Training{folder.path(), n_threads}().first), expected) << n_threads;
  }
  const TestFolder parts;
  std::atomic<bool> stop = true;
  EXPECT_THROW((Training{parts.path(), 1, &stop}()), Interrupted);
  EXPECT_FALSE(std::filesystem::exists(parts / "checkpoint.npz")) << "nothing is chosen yet";
  EXPECT_TRUE(std::filesystem::exists(parts / "starts/1/checkpoint.npz"));
  stop = false;
  Training rest{parts.path(), 1, &stop};
  rest.observer = [&](int64_t step, const Policy&, double) { stop = step == 400; };
  EXPECT_THROW(rest(), Interrupted);
  stop = false;
  const auto [resumed, resumed_gain] = rest();
  EXPECT_EQ(resumed, expected);
  EXPECT_EQ(resumed_gain, gain);
}

}  // namespace oted::starts_test
