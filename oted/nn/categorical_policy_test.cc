#include "oted/nn/categorical_policy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::categorical_policy_test {

CategoricalPolicy MakePolicy(bool images) {
  Rng rng(1);
  Array2<double> observations(50, 10);
  for (double& value : observations.values()) value = static_cast<double>(rng.Below(2));
  InputShape shape;
  if (images) shape = {.image = {3, 3, 1}, .levels = {2, 2, 2, 2, 2, 2, 2, 2, 2, 2}};
  CategoricalPolicy policy(observations, shape, {.hidden = {6}, .filters = {4}}, 3);
  policy.net().Initialize(rng);
  return policy;
}

std::vector<double> Actions(const Policy& policy, ActionNoise noise, double scale = 1) {
  const std::vector<double> s = {0, 1, 0, 1, 1, 0, 0, 1, 1, 0};
  std::vector<double> many, actions(500);
  for (int i = 0; i < 500; ++i) many.insert(many.end(), s.begin(), s.end());
  Rng rng(2);
  policy.MakeActor(noise, scale)->Act(many, 500, rng, actions);
  return actions;
}

TEST(CategoricalPolicy, AFileGivesItBackAsWhatItIs) {
  const TestFolder folder;
  for (const bool images : {false, true}) {
    const CategoricalPolicy policy = MakePolicy(images);
    policy.Save(folder.path() / "policy.npz");
    const std::unique_ptr<Policy> read = LoadPolicy(folder.path() / "policy.npz");
    EXPECT_NE(dynamic_cast<const CategoricalPolicy*>(read.get()), nullptr);
    EXPECT_EQ(read->obs_dim(), 10);
    EXPECT_EQ(Actions(*read, ActionNoise::kSampled), Actions(policy, ActionNoise::kSampled));
  }
}

TEST(CategoricalPolicy, NoNoiseIsTheMostProbableActionAndMuchNoiseAllOfThem) {
  const CategoricalPolicy policy = MakePolicy(true);
  const std::vector<double> best = Actions(policy, ActionNoise::kMean);
  for (const double action : best) EXPECT_EQ(action, best[0]);
  EXPECT_EQ(Actions(policy, ActionNoise::kSampled, 0), best);
  std::vector<int> count(3, 0);
  for (const double action : Actions(policy, ActionNoise::kSampled, 1e6)) ++count[static_cast<size_t>(action)];
  for (const int n : count) EXPECT_NEAR(n / 500.0, 1.0 / 3, 0.08);
}

TEST(CategoricalPolicy, ADamagedFileIsADataErrorThatNamesIt) {
  const TestFolder folder;
  const auto path = folder.path() / "policy.npz";
  MakePolicy(true).Save(path);
  const NpzArrays whole = ReadNpz(path);
  for (const auto& [name, array] : whole) {
    if (name == CategoricalPolicy::kMark) continue;  // without it the file is another kind's
    NpzArrays damaged = whole;
    damaged[name] = NpyArray(std::vector<double>{-1e300, 7});
    WriteNpz(damaged, path);
    const std::string message = MessageOf<DataError>([&] { CategoricalPolicy::Load(path); });
    EXPECT_NE(message.find("policy.npz"), std::string::npos) << name << ": " << message;
  }
}

}  // namespace oted::categorical_policy_test
