#include "oted/nn/planner_policy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/onnx_export.h"

namespace oted::planner_policy_test {

/// Linear networks: s' = s, r = reward_of_action a, prior = prior_of_state s, R = 0. One state, one action in [-2, 2].
PlannerPolicy Linear(double reward_of_action, double prior_of_state, const PlanOptions& options, int n_members = 1) {
  PlannerMember member{Mlp(2, {}, 2), Mlp(2, {}, 1), Mlp(2, {}, 1)};
  for (Mlp* net : {&member.dynamics, &member.prior, &member.value}) {
    std::fill(net->parameters().begin(), net->parameters().end(), 0.0f);
  }
  member.dynamics.parameters()[0] = 1;                                     // of s in s'; (in, out) row-major
  member.dynamics.parameters()[3] = static_cast<float>(reward_of_action);  // of a in r
  member.prior.parameters()[0] = static_cast<float>(prior_of_state);
  return {std::vector(static_cast<size_t>(n_members), member), {{{0}, {1}}, 0, 1, 0, 1, {-2}, {2}}, options};
}

double ActOnce(PolicyActor& actor, double state, Rng& rng) {
  std::vector<double> action(1);
  actor.Act(std::vector<double>{state}, 1, rng, action);
  return action[0];
}

TEST(PlannerPolicy, TheWeightedMeanIsThatOfATiltedNormal) {
  // With R = sum of a and a ~ N(0, sigma^2), the weights exp(kappa R) move every action's mean to kappa sigma^2; where
  // a share beta of the former plan T is kept, to (1 - beta)^2 kappa sigma^2 + beta T.
  constexpr double kSigma = 0.2, kKappa = 2, kBeta = 0.25;
  for (const int n_members : {1, 3}) {
    const PlannerPolicy policy = Linear(1, 0, {3, 40'000, kSigma, kBeta, kKappa}, n_members);
    const auto actor = policy.MakeActor(ActionNoise::kMean);
    Rng rng(1);
    const double tilt = (1 - kBeta) * (1 - kBeta) * kKappa * kSigma * kSigma;
    actor->Begin(1);
    // An action's range is [-2, 2], twice that of the networks.
    EXPECT_NEAR(ActOnce(*actor, 0, rng), 2 * tilt, 0.01);
    EXPECT_NEAR(ActOnce(*actor, 0, rng), 2 * (tilt + kBeta * tilt), 0.01);
  }
}

TEST(PlannerPolicy, APlanStaysWithItsRowWhenOthersEnd) {
  // Without noise and weights: a = (1 - beta) s + beta T.
  const PlannerPolicy policy = Linear(0, 1, {2, 3, 0, 0.5, 0});
  const auto actor = policy.MakeActor(ActionNoise::kMean);
  Rng rng(1);
  std::vector<double> actions(2);
  actor->Begin(2);
  actor->Act(std::vector<double>{0.5, -0.5}, 2, rng, actions);
  EXPECT_NEAR(actions[0], 2 * 0.25, 1e-6);
  EXPECT_NEAR(actions[1], 2 * -0.25, 1e-6);
  actor->Keep(std::vector<int>{1});
  EXPECT_NEAR(ActOnce(*actor, -0.5, rng), 2 * (-0.25 - 0.125), 1e-6);
  actor->Begin(1);
  EXPECT_NEAR(ActOnce(*actor, -0.5, rng), 2 * -0.25, 1e-6) << "an episode begins with no plan";
}

TEST(PlannerPolicy, AModelThatBreaksDownGivesAFiniteAction) {
  PlannerPolicy broken = Linear(1, 0, {4, 8, 0.1, 0, 1});
  PlannerMember member = broken.members()[0];
  member.dynamics.parameters()[0] = 1e30f;
  const PlannerPolicy policy({member}, broken.units(), broken.options());
  Rng rng(1);
  EXPECT_TRUE(std::isfinite(ActOnce(*policy.MakeActor(ActionNoise::kMean), 1, rng)));
}

TEST(PlannerPolicy, AFileHoldsAllOfIt) {
  const TestFolder folder;
  const PlannerPolicy policy = Linear(1, 0.5, {3, 50, 0.3, 0.2, 1.5}, 2);
  policy.Save(folder / "policy.npz");
  const auto loaded = LoadPolicy(folder / "policy.npz");
  Rng one(3), other(3);
  const auto a = policy.MakeActor(ActionNoise::kMean), b = loaded->MakeActor(ActionNoise::kMean);
  for (const double state : {0.3, -0.8, 0.1}) EXPECT_EQ(ActOnce(*a, state, one), ActOnce(*b, state, other));
}

TEST(PlannerPolicy, ADamagedFileIsADataErrorThatNamesTheArray) {
  const TestFolder folder;
  Linear(1, 0, {3, 50, 0.3, 0.2, 1.5}).Save(folder / "policy.npz");
  const NpzArrays sound = ReadNpz(folder / "policy.npz");
  for (const auto& [name, unused] : sound) {
    if (name == PlannerPolicy::kMark) continue;
    NpzArrays damaged = sound;
    damaged.erase(name);
    EXPECT_THROW(PlannerPolicy::FromArrays(damaged, "x.npz"), DataError) << name;
    damaged[name] = NpyArray(std::vector<double>{NAN});
    EXPECT_THROW(PlannerPolicy::FromArrays(damaged, "x.npz"), DataError) << name;
  }
  NpzArrays damaged = sound;
  damaged[PlannerPolicy::kMark] = NpyArray(std::vector<double>{1e9, 1e9, 0, 0, 0});
  EXPECT_NE(MessageOf<DataError>([&] { PlannerPolicy::FromArrays(damaged, "x.npz"); }).find("'planner/plan'"),
            std::string::npos);
}

TEST(PlannerPolicy, AskedForAsONNXItIsAUsageError) {
  EXPECT_NE(MessageOf<UsageError>([] { OnnxBytes(Linear(1, 0, {}), {}); }).find("no ONNX form"), std::string::npos);
}

}  // namespace oted::planner_policy_test
