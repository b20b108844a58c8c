#include "oted/stages/design/images/ratio_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/categorical_policy.h"
#include "oted/sim/minigrid/density_likelihood.h"
#include "oted/sim/minigrid/expert.h"
#include "oted/stages/design/design_config.h"

namespace oted::ratio_matching_test {

/// Rooms of side 4, which are seen nearly whole.
class SmallRooms : public testing::Test {
 protected:
  static constexpr double kTruth = 0.4;

  SmallRooms() {
    // Uniformly random actions; and as their clone, a network that has seen nothing.
    logs_ = CollectMinigridDemonstrations(factory_, {kTruth}, MinigridMedium(1.0), 60, RngKey(1), 1);
    config_ = DesignConfig::For(DesignMethod::kImages);
    config_.images.n_iterations = 20;
    config_.images.n_sims = 64;
    config_.discriminator.filters = {8};
    config_.discriminator.hidden = {16};
    Rng init = RngKey(2).MakeRng();
    clone_ = CategoricalPolicy(logs_.observations, ObservationShape(factory_.spec()), {{8}, {4}, false},
                               factory_.spec().n_discrete_actions);
    clone_.net().Initialize(init);
  }

  Designer Design(const Designer& prior, RngKey key, int n_threads = 1) const {
    NullSink log;
    const RatioProgress nothing = [](int, const Designer&, double) {};
    const RunContext context{&log, nullptr, n_threads};
    const EvidenceConfig evidence = config_.adversarial.Evidence(factory_.spec());
    return MatchRatios({factory_, logs_, &clone_, evidence, prior, key, nothing, context}, config_.images,
                       config_.discriminator);
  }
  double Yardstick() const {
    DensityLikelihood likelihood(task_);
    likelihood.Add(logs_);
    return likelihood.Maximum(0, 0.6).density;
  }

  MinigridTask task_ = FindMinigridTask("MiniGrid-Obstacles-6x6");
  MinigridSimulatorFactory factory_{
      task_, {{.name = "density", .field = "env/density", .low = 0, .high = 0.6, .scale = ParameterScale::kAbsolute}}};
  Dataset logs_;
  DesignConfig config_;
  CategoricalPolicy clone_;
};

TEST_F(SmallRooms, TheDensityIsFoundAsNearAsTheCellsSeenAllow) {
  const Designer q = Design(Designer(factory_.parameters(), 1.0), RngKey(3));
  EXPECT_NEAR(q.Mode()[0], Yardstick(), 0.04);
  // 60 rooms of 14 cells: a standard error of at least sqrt(0.4 0.6 / 840) = 0.017, more for the cells not seen.
  EXPECT_GT(q.Std()[0], 0.014);
  EXPECT_LT(q.Std()[0], 0.040);
}

TEST_F(SmallRooms, ACategoricalDesignerPutsItsWeightOnTheGridValuesAround) {
  const Designer q = Design(Designer::OnGrid(factory_.parameters(), 0.1), RngKey(4));
  EXPECT_NEAR(q.Mode()[0], 0.4, 1e-9);
  EXPECT_LT(q.grid()->probabilities(0)[1], 0.05);  // 0.1
}

TEST_F(SmallRooms, TheThreadsDoNotChangeTheBytes) {
  config_.images.n_iterations = 2;
  const Designer prior(factory_.parameters(), 1.0);
  EXPECT_EQ(Design(prior, RngKey(5), 1).State(), Design(prior, RngKey(5), 2).State());
}

TEST_F(SmallRooms, EpisodesShorterThanASampleAreADataError) {
  config_.adversarial.horizon = config_.adversarial.stack = 200;
  EXPECT_THAT(MessageOf<DataError>([&] { Design(Designer(factory_.parameters(), 1.0), RngKey(6)); }),
              testing::HasSubstr("200 steps"));
}

}  // namespace oted::ratio_matching_test
