#include "oted/stages/agent/agent.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <mutex>
#include <set>

#include "oted/base/statistics.h"
#include "oted/base/testing.h"
#include "oted/rl/sac.h"
#include "oted/sim/testing.h"

namespace oted::agent_test {

constexpr int kTrainingLanes = 2;  // one more than evaluation has: so the recorder knows which simulator is which

/// The gains of the episodes that began, by simulator size and lane.
struct Episodes {
  std::mutex mutex;
  std::map<int, std::map<int, std::vector<double>>> gains;
};

class Recording : public PointMass {
 public:
  Recording(const PointMassOptions& options, int n_lanes, Episodes* episodes)
      : PointMass(options, n_lanes, 1), episodes_(episodes), gain_(static_cast<size_t>(n_lanes)) {}
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, z);
    gain_[static_cast<size_t>(lane)] = z[0];
  }
  void Reset(int lane, Rng& rng) override {
    PointMass::Reset(lane, rng);
    const std::lock_guard lock(episodes_->mutex);
    episodes_->gains[n_lanes()][lane].push_back(gain_[static_cast<size_t>(lane)]);
  }

 private:
  Episodes* episodes_;
  std::vector<double> gain_;
};

class RecordingFactory : public PointMassFactory {
 public:
  explicit RecordingFactory(Episodes* episodes) : PointMassFactory(kOptions), episodes_(episodes) {}
  std::unique_ptr<Simulator> Make(int n_lanes, int) const override {
    return std::make_unique<Recording>(kOptions, n_lanes, episodes_);
  }

 private:
  static constexpr PointMassOptions kOptions{.max_episode_steps = 4};
  Episodes* episodes_;
};

SacConfig NoLearning(int64_t n_steps) {
  SacConfig config;
  config.n_steps = n_steps;
  config.n_lanes = kTrainingLanes;
  config.learning_starts = n_steps;
  config.buffer_size = n_steps;
  config.hidden = {4};
  config.eval_interval = n_steps;
  config.eval_episodes = 1;
  return config;
}

void Train(Episodes* episodes, EpisodeSource& where, const std::vector<std::vector<double>>& evaluate_in,
           const SacConfig& config) {
  const TestFolder folder;
  NullSink log;
  TrainAgent({.factory = RecordingFactory(episodes),
              .source = where,
              .eval_parameters = evaluate_in,
              .key = RngKey(5),
              .folder = folder.path(),
              .run_name = "agents/1",
              .context = {.log = &log, .n_threads = 1}},
             config);
}

TEST(TrainAgent, DrawsAModeUniformlyAndAnewForEachEpisode) {
  const std::vector<std::vector<double>> modes = {{0.5, 1, 0}, {1.0, 1, 0}, {1.5, 1, 0}};
  Episodes episodes;
  DrawnEpisodes where(DrawModes(modes));
  Train(&episodes, where, modes, NoLearning(7200));

  std::map<double, int> counts;
  int n = 0, repeats = 0, pairs = 0;
  ASSERT_EQ(episodes.gains[kTrainingLanes].size(), 2u);
  for (const auto& [lane, gains] : episodes.gains[kTrainingLanes]) {
    for (size_t i = 0; i < gains.size(); ++i, ++n) {
      ++counts[gains[i]];
      if (i > 0) repeats += gains[i] == gains[i - 1];
      if (i > 0) ++pairs;
    }
  }
  ASSERT_GE(n, 1800) << "7200 steps in episodes of four";
  ASSERT_EQ(counts.size(), 3u);
  // Binomial(n, 1/3) within five standard deviations; so are the repeats of independent draws.
  const double deviation = 5 * std::sqrt(n * (1.0 / 3) * (2.0 / 3));
  for (const auto& [gain, count] : counts) EXPECT_NEAR(count, n / 3.0, deviation) << gain;
  EXPECT_NEAR(repeats, pairs / 3.0, deviation) << "a mode says nothing about the next";
}

TEST(TrainAgent, WithOneModeEveryEpisodeHasIt) {
  Episodes episodes;
  DrawnEpisodes where(DrawModes({{1.3, 1, 0}}));
  Train(&episodes, where, {{1.3, 1, 0}}, NoLearning(80));
  ASSERT_FALSE(episodes.gains.empty());
  for (const auto& [size, lanes] : episodes.gains) {
    for (const auto& [lane, gains] : lanes) {
      for (const double gain : gains) EXPECT_EQ(gain, 1.3) << "of a simulator with " << size << " lanes";
    }
  }
}

/// Mean and standard deviation of some numbers.
std::pair<double, double> MomentsOf(const std::vector<double>& x) { return {Mean(x), StandardDeviation(x)}; }

TEST(TrainAgent, SamplesHaveTheMeanAndTheSpreadOfTheirQ) {
  // Two seeds' q of the gain, in logits of its range: N(-1, 0.3^2) and N(1, 0.1^2).
  const ParameterSpace space = PointMass::MakeParameters();
  const auto q = [&](double mean, double std) {
    return Designer(space, Eigen::Vector3d(mean, 0, 0), Eigen::Vector3d(std * std, 0.01, 0.01).asDiagonal());
  };
  Episodes episodes;
  DrawnEpisodes where(DrawSamples({q(-1, 0.3), q(1, 0.1)}));
  Train(&episodes, where, {{1, 1, 0}}, NoLearning(7200));

  std::vector<double> low, high;
  std::set<double> distinct;
  for (const auto& [lane, gains] : episodes.gains[kTrainingLanes]) {
    for (const double gain : gains) {
      const double x = ZToLogit(space, std::vector{gain, 0.6, 0.5})[0];
      (x < 0.3 ? low : high).push_back(x);
      distinct.insert(gain);
    }
  }
  const size_t n = low.size() + high.size();
  ASSERT_GE(n, 1800u);
  EXPECT_EQ(distinct.size(), n) << "each episode has a draw of its own";
  EXPECT_NEAR(static_cast<double>(low.size()), static_cast<double>(n) / 2, 5 * std::sqrt(static_cast<double>(n) / 4));
  EXPECT_NEAR(MomentsOf(low).first, -1, 5 * 0.3 / std::sqrt(low.size()));
  EXPECT_NEAR(MomentsOf(low).second, 0.3, 5 * 0.3 / std::sqrt(2.0 * static_cast<double>(low.size())));
  EXPECT_NEAR(MomentsOf(high).first, 1, 5 * 0.1 / std::sqrt(high.size()));
  EXPECT_NEAR(MomentsOf(high).second, 0.1, 5 * 0.1 / std::sqrt(2.0 * static_cast<double>(high.size())));
}

}  // namespace oted::agent_test
