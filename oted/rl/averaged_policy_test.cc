/// The policy that is evaluated and kept, averaged over gradient steps.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "oted/base/testing.h"
#include "oted/rl/replay_training.h"
#include "oted/sim/testing.h"

namespace oted::averaged_policy_test {

/// A learner whose every weight is the number of gradient steps made.
class CountingUpdate : public ReplayUpdate {
 public:
  explicit CountingUpdate(TanhGaussianPolicy actor) : actor_(std::move(actor)) { Set(0); }
  ReplayLosses Step(const TransitionBatch&) override {
    Set(count_ + 1);
    return {};
  }
  const TanhGaussianPolicy& actor() const override { return actor_; }
  void Save(NpzArrays&) override {}
  void Restore(const NpzArrays&) override {}

 private:
  void Set(float count) {
    count_ = count;
    std::ranges::fill(actor_.net().parameters(), count);
  }
  TanhGaussianPolicy actor_;
  float count_ = 0;
};

/// A weight of the kept policy after `n` gradient steps.
double KeptWeight(int64_t average_over, int64_t n) {
  const TestFolder folder;
  NullSink log;
  DrawnEpisodes source([](Rng&) { return std::vector<double>{1, 1, 0}; });
  ReplayConfig config;
  config.learning_starts = 2;
  config.n_steps = config.eval_interval = n + 1;  // one gradient step after each control step from the second on
  config.eval_episodes = 1;
  config.hidden = {2};
  config.batch_size = 1;
  config.average_over = average_over;
  const ReplayAgent agent = TrainByReplay(
      {.factory = PointMassFactory(),
       .source = source,
       .eval_parameters = {{1, 1, 0}},
       .key = RngKey(1),
       .folder = folder.path(),
       .run_name = "agent",
       .context = {&log, nullptr, 1}},
      config, "sac", [](TanhGaussianPolicy actor, Rng&) { return std::make_unique<CountingUpdate>(std::move(actor)); });
  return agent.policy.net().parameters()[0];
}

TEST(AveragedPolicy, IsTheLastOneWhereNothingIsAveraged) { EXPECT_EQ(KeptWeight(1, 100), 100); }

TEST(AveragedPolicy, IsTheMeanOfEveryEighthWhileThereAreFewerThanAskedFor) {
  // Looked at after gradient steps 1, 9, ..., 8 m + 1 <= n: the mean of an arithmetic sequence.
  for (const int64_t n : {1, 8, 9, 100}) {
    EXPECT_NEAR(KeptWeight(1'000'000, n), 1 + 4.0 * static_cast<double>((n - 1) / 8), 1e-3) << n;
  }
}

TEST(AveragedPolicy, FollowsARampAtTheDistanceOfItsLength) {
  // A running mean with share s of each look follows a ramp of 8 a look at a distance of 8 (1 - s) / s.
  const double share = 8.0 / 80;
  EXPECT_NEAR(KeptWeight(80, 2001), 2001 - 8 * (1 - share) / share, 1e-2);
}

}  // namespace oted::averaged_policy_test
