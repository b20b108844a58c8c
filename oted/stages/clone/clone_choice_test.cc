#include "oted/stages/clone/clone_choice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/testing.h"

namespace oted::clone_choice_test {

PointMassOptions Options() {
  PointMassOptions options;
  options.max_episode_steps = 15;
  return options;
}

/// u ~ N(-1.2 x - 0.3 v, 0.25^2) in the point mass with some momentum.
Dataset Demonstrations(int n_episodes) {
  PointMass simulator(Options(), n_episodes, 1);
  Rng rng(1);
  const auto act = [&](std::span<const double> s, int n, std::span<double> actions) {
    for (size_t i = 0; i < static_cast<size_t>(n); ++i) {
      actions[i] = std::tanh(-1.2 * s[2 * i] - 0.3 * s[2 * i + 1] + 0.25 * rng.Normal());
    }
  };
  EpisodeRecorder recorder(n_episodes);
  const std::vector<double> z = {1.0, 0.6, 0.5};
  RunEpisodes(simulator, std::vector(static_cast<size_t>(n_episodes), z), act, RngKey(2), recorder.Observer());
  return recorder.Logs();
}

CloneConfig SmallConfig() {
  CloneConfig config;
  config.method = CloneMethod::kAuto;
  config.hidden = {16};
  config.max_steps = 800;
  config.valuedice_updates = 20;
  config.valuedice_batch = 32;
  config.valuedice_hidden = {16};
  return config;
}

CloneResult Clone(const Dataset& logs, const CloneConfig& config, bool with_simulator) {
  NullSink log;
  const PointMassFactory factory(Options());
  const RunContext context{&log, nullptr, 1};
  const CloneJob job{logs, factory.spec(), config, RngKey(3), "clone", context, with_simulator ? &factory : nullptr};
  return config.method == CloneMethod::kAuto ? ChooseClone(job, 40) : CloneBehavior(job);
}

const AlignedVector<float>& Weights(const CloneResult& clone) {
  return dynamic_cast<const TanhGaussianPolicy&>(*clone.policy).net().parameters();
}

TEST(ChooseClone, ThrowsOutAValueDiceThatWasSpoiltAndGivesWhatBehaviouralCloningGivesAlone) {
  const Dataset logs = Demonstrations(25);
  CloneConfig config = SmallConfig();  // from random weights with next to no updates
  config.valuedice_start = ValueDiceStart::kRandomWeights;
  const CloneResult kept = Clone(logs, config, true);
  EXPECT_EQ(kept.method, CloneMethod::kBehavioralCloning);
  ASSERT_TRUE(kept.choice);
  EXPECT_LT(kept.choice->bc.held_out_loss, kept.choice->valuedice.held_out_loss);
  EXPECT_GT(*kept.choice->bc.closeness, *kept.choice->valuedice.closeness + kMargin);
  EXPECT_LE(*kept.choice->bc.closeness, std::log(2.0) + 1e-9);
  config.method = CloneMethod::kBehavioralCloning;
  EXPECT_EQ(Weights(kept), Weights(Clone(logs, config, true)));
}

TEST(ChooseClone, ThrowsOutABehaviouralCloneThatWasSpoiltAndGivesWhatValueDiceGivesAlone) {
  const Dataset logs = Demonstrations(25);
  CloneConfig config = SmallConfig();
  config.hidden = {};
  config.max_steps = 1;
  config.learning_rate = 1e-6;
  config.valuedice_updates = 3'000;
  config.valuedice_batch = 128;
  config.valuedice_actor_rate = 1e-3;
  config.valuedice_discount = 0;  // with a future its spread comes out narrow
  config.valuedice_penalty = 1;
  const CloneResult kept = Clone(logs, config, false);
  EXPECT_EQ(kept.method, CloneMethod::kValueDice) << kept.choice->reason;
  EXPECT_FALSE(kept.choice->bc.closeness);
  config.method = CloneMethod::kValueDice;
  EXPECT_EQ(Weights(kept), Weights(Clone(logs, config, false)));
}

}  // namespace oted::clone_choice_test
