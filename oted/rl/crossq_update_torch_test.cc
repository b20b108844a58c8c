#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/autograd/autograd_crossq.h"
#include "oted/rl/crossq_update.h"
#include "oted/rl/replay_torch_testing.h"

namespace oted::crossq_update_torch_test {

TanhGaussianPolicy MakePolicy(int obs_dim, int act_dim, const std::vector<int>& hidden) {
  const std::vector<double> low(static_cast<size_t>(act_dim), -1.0), high(static_cast<size_t>(act_dim), 1.0);
  return TanhGaussianPolicy(
      {std::vector<double>(static_cast<size_t>(obs_dim), 0.0), std::vector<double>(static_cast<size_t>(obs_dim), 1.0)},
      hidden, low, high);
}

CrossQUpdate MakeUpdate(int obs_dim, int act_dim, const std::vector<int>& hidden, const CrossQUpdateOptions& options) {
  Rng rng(11);
  return CrossQUpdate(MakePolicy(obs_dim, act_dim, hidden), hidden, options, rng);
}

// Adam divides a gradient by its own size, so where a gradient's terms cancel to their rounding error a step is that
// error's sign. With batch normalisation this is so at once for the bias of a layer whose outputs are normalised after
// the rectifier of dead units, and elsewhere over many steps.
constexpr double kTolerance = 3e-5;

void CompareOverSteps(int obs_dim, int act_dim, int64_t renorm_warmup) {
  torch::set_num_threads(1);
  CrossQUpdateOptions options;
  options.learning_rate = 3e-4;
  options.target_entropy = -act_dim;
  options.momentum = 0.05;
  options.renorm_warmup = renorm_warmup;
  CrossQUpdate update = MakeUpdate(obs_dim, act_dim, {128, 128}, options);
  const auto actor_start = update.actor_net().parameters();
  const auto running_start = update.critic(0).running();
  AutogradCrossQ reference(update, options, torch::kFloat64);
  Rng rng(12);
  for (int step = 0; step < 60; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    ExpectNear(update.Step(batch), reference.Step(batch), step);
  }
  EXPECT_LT(MaxDifference(update.actor_net().parameters(), Flattened(reference.actor.parameters)), kTolerance);
  EXPECT_LT(MaxDifference(update.actor_net().running(), Flattened({reference.actor.running})), kTolerance);
  for (int i = 0; i < 2; ++i) {
    const size_t k = static_cast<size_t>(i);
    EXPECT_LT(MaxDifference(update.critic(i).parameters(), Flattened(reference.critics[k].parameters)), kTolerance)
        << i;
    EXPECT_LT(MaxDifference(update.critic(i).running(), Flattened({reference.critics[k].running})), 10 * kTolerance)
        << i;
  }
  EXPECT_NEAR(update.log_alpha(), reference.temperature.flat.item<double>(), kTolerance);
  // What is compared has moved by far more than the tolerance.
  EXPECT_GT(MaxDifference(update.actor_net().parameters(), actor_start), 100 * kTolerance);
  EXPECT_GT(MaxDifference(update.critic(0).running(), running_start), 100 * kTolerance);
  EXPECT_GT(std::abs(update.log_alpha()), 100 * kTolerance);
}

TEST(CrossQUpdateAgainstAutograd, StaysEqualOverSixtyStepsByTheBatchsStatistics) { CompareOverSteps(17, 6, 100); }
TEST(CrossQUpdateAgainstAutograd, StaysEqualOverSixtyStepsWhereRenormalisationBegins) { CompareOverSteps(11, 3, 20); }

TEST(CrossQUpdate, TheActorMovesInEveryThirdStepAlone) {
  CrossQUpdateOptions options;
  options.target_entropy = -2;
  CrossQUpdate update = MakeUpdate(3, 2, {16}, options);
  Rng rng(15);
  for (int step = 1; step <= 9; ++step) {
    const auto before = update.actor().net().parameters();
    const double log_alpha = update.log_alpha();
    update.Step(RandomBatch(3, 2, rng));
    EXPECT_EQ(update.actor().net().parameters() != before, step % 3 == 0) << step;
    EXPECT_EQ(update.log_alpha() != log_alpha, step % 3 == 0) << step;
  }
}

TEST(CrossQUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  const int obs_dim = 3, act_dim = 2;
  CrossQUpdateOptions options;
  options.target_entropy = -act_dim;
  Rng rng(15);
  CrossQUpdate update = MakeUpdate(obs_dim, act_dim, {16}, options);
  for (int step = 0; step < 5; ++step) update.Step(RandomBatch(obs_dim, act_dim, rng));
  NpzArrays arrays;
  update.Save(arrays);
  CrossQUpdate restored = MakeUpdate(obs_dim, act_dim, {16}, options);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  for (int step = 0; step < 7; ++step) {
    const TransitionBatch batch = RandomBatch(obs_dim, act_dim, rng);
    const ReplayLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.critic_loss, b.critic_loss);
    if (step > 0) {  // before, the loss is of a step that the restored one has not seen
      EXPECT_EQ(a.actor_loss, b.actor_loss);
    }
  }
  EXPECT_EQ(update.actor().net().parameters(), restored.actor().net().parameters());
  EXPECT_EQ(update.critic(1).parameters(), restored.critic(1).parameters());
  EXPECT_EQ(update.critic(1).running(), restored.critic(1).running());
}

}  // namespace oted::crossq_update_torch_test
