#include "oted/stages/agent/agent.h"

#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "oted/base/testing.h"
#include "oted/sim/testing.h"

namespace oted {
namespace {

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

TEST(TrainAgent, DrawsAModeUniformlyAndAnewForEachEpisode) {
  const std::vector<std::vector<double>> modes = {{0.5, 1, 0}, {1.0, 1, 0}, {1.5, 1, 0}};
  Episodes episodes;
  const TestFolder folder;
  NullSink log;
  TrainAgent(RecordingFactory(&episodes), modes, NoLearning(7200), RngKey(5), folder.path(), "agents/1",
             {.log = &log, .n_threads = 1});

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
  const TestFolder folder;
  NullSink log;
  TrainAgent(RecordingFactory(&episodes), {{1.3, 1, 0}}, NoLearning(80), RngKey(5), folder.path(), "agents/1",
             {.log = &log, .n_threads = 1});
  ASSERT_FALSE(episodes.gains.empty());
  for (const auto& [size, lanes] : episodes.gains) {
    for (const auto& [lane, gains] : lanes) {
      for (const double gain : gains) EXPECT_EQ(gain, 1.3) << "of a simulator with " << size << " lanes";
    }
  }
}

}  // namespace
}  // namespace oted
