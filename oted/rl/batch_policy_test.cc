#include "oted/rl/batch_policy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/nn/categorical_policy.h"
#include "oted/sim/testing.h"

namespace oted::batch_policy_test {

/// u ~ N(x / 2, e^-1).
TanhGaussianPolicy MakePolicy() {
  TanhGaussianPolicy policy(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  auto& p = policy.net().parameters();
  std::fill(p.begin(), p.end(), 0.0f);
  p[0] = 0.5f;   // x -> mean
  p[5] = -1.0f;  // log std
  return policy;
}

const std::vector<double> kObservations = {0.4, 0, -0.8, 0, 2, 0};

std::vector<double> Actions(const BatchPolicy& policy) {
  std::vector<double> actions(3);
  policy(kObservations, 3, actions);
  return actions;
}

TEST(MeanActionPolicy, GivesTheMeanActionEveryTime) {
  const TanhGaussianPolicy policy = MakePolicy();
  const BatchPolicy act = MeanActionPolicy(policy);
  const std::vector<double> first = Actions(act);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(first[i], std::tanh(kObservations[2 * i] / 2), 1e-6);
  EXPECT_EQ(Actions(act), first);
}

TEST(AsBatchPolicy, DrawsWhatTheRunnerDrawsFromThatStream) {
  const TanhGaussianPolicy policy = MakePolicy();
  const BatchPolicy act = AsBatchPolicy(policy, ActionNoise::kSampled, Rng(7));
  PolicyRunner runner(policy, ActionNoise::kSampled);
  Rng rng(7);
  for (int call = 0; call < 3; ++call) {
    std::vector<double> expected(3);
    runner.Act(kObservations, 3, rng, expected);
    EXPECT_EQ(Actions(act), expected) << call;
  }
}

TEST(AsBatchPolicy, ACopyGoesOnWithTheSameStream) {
  const TanhGaussianPolicy policy = MakePolicy();
  const BatchPolicy one = AsBatchPolicy(policy, ActionNoise::kSampled, Rng(7)), copy = one;
  const BatchPolicy alone = AsBatchPolicy(policy, ActionNoise::kSampled, Rng(7));
  const std::vector<double> first = Actions(one), second = Actions(copy);
  EXPECT_EQ(Actions(alone), first);
  EXPECT_EQ(Actions(alone), second);
}

TEST(LoadBatchPolicy, BothFilesOfAPolicyGiveItsMeanAction) {
  const TestFolder folder;
  const TanhGaussianPolicy policy = MakePolicy();
  const SimulatorSpec spec = PointMass::MakeSpec({});
  policy.Save(folder / "policy.npz");
  WriteOnnx(policy, PolicyMetadata(spec, "a test"), folder / "policy.onnx");
  const std::vector<double> expected = Actions(MeanActionPolicy(policy));
  EXPECT_EQ(Actions(LoadBatchPolicy(folder / "policy.npz", spec)), expected);
  const std::vector<double> read = Actions(LoadBatchPolicy(folder / "policy.onnx", spec));
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(read[i], expected[i], 1e-6);
}

TEST(LoadBatchPolicy, AFileOfAnotherTaskOrKindIsADataErrorThatNamesIt) {
  const TestFolder folder;
  SimulatorSpec spec = PointMass::MakeSpec({});
  MakePolicy().Save(folder / "policy.npz");
  WriteOnnx(MakePolicy(), {}, folder / "policy.onnx");
  WriteFileAtomically(folder / "policy.pt", "");
  EXPECT_THROW(LoadBatchPolicy(folder / "policy.pt", spec), DataError);
  spec.act_dim = 2;
  for (const char* name : {"policy.npz", "policy.onnx"}) {
    const std::string message = MessageOf<DataError>([&] { LoadBatchPolicy(folder / name, spec); });
    EXPECT_NE(message.find(name), std::string::npos);
    EXPECT_NE(message.find("PointMass"), std::string::npos);
  }
}

/// Three actions with probabilities 0.6, 0.3, 0.1 whatever is seen.
CategoricalPolicy Lottery() {
  Array2<double> rows(2, 2, 1.0);
  CategoricalPolicy policy(rows, {}, {}, 3);
  auto& p = policy.net().parameters();
  std::fill(p.begin(), p.end(), 0.0f);
  const float chances[] = {0.6f, 0.3f, 0.1f};
  for (size_t i = 0; i < 3; ++i) p[6 + i] = std::log(chances[i]);
  return policy;
}

SimulatorSpec Discrete(int n_actions) {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.n_discrete_actions = n_actions;
  return spec;
}

TEST(LoadBatchPolicy, DiscreteActionsOfBothFilesAreDrawnOrTheMostProbable) {
  const TestFolder folder;
  Lottery().Save(folder / "policy.npz");
  WriteOnnx(Lottery(), {}, folder / "policy.onnx");
  constexpr int kDraws = 3000;
  const std::vector<double> observations(2 * kDraws);
  for (const char* name : {"policy.npz", "policy.onnx"}) {
    std::vector<double> actions(kDraws);
    LoadBatchPolicy(folder / name, Discrete(3), ActionNoise::kSampled, Rng(5))(observations, kDraws, actions);
    EXPECT_NEAR(std::ranges::count(actions, 0.0), 0.6 * kDraws, 5 * std::sqrt(0.24 * kDraws)) << name;
    EXPECT_NEAR(std::ranges::count(actions, 2.0), 0.1 * kDraws, 5 * std::sqrt(0.09 * kDraws)) << name;
    LoadBatchPolicy(folder / name, Discrete(3))(observations, kDraws, actions);
    EXPECT_EQ(std::ranges::count(actions, 0.0), kDraws) << name;
  }
}

TEST(LoadBatchPolicy, APolicyOfOtherActionsIsADataErrorThatNamesBoth) {
  const TestFolder folder;
  Lottery().Save(folder / "policy.npz");
  WriteOnnx(Lottery(), {}, folder / "policy.onnx");
  MakePolicy().Save(folder / "other.npz");
  const auto message = [&](const char* name, const SimulatorSpec& spec) {
    return MessageOf<DataError>([&] {
      std::vector<double> action(1);
      const BatchPolicy act = LoadBatchPolicy(folder / name, spec, ActionNoise::kSampled);
      act(std::vector<double>{0, 0}, 1, action);
    });
  };
  EXPECT_NE(message("policy.npz", Discrete(2)).find("3 discrete actions"), std::string::npos);
  EXPECT_NE(message("policy.npz", PointMass::MakeSpec({})).find("has continuous ones"), std::string::npos);
  EXPECT_NE(message("other.npz", Discrete(3)).find("has continuous actions"), std::string::npos);
  EXPECT_NE(message("policy.onnx", Discrete(7)).find("3 actions"), std::string::npos);
}

TEST(LoadBatchPolicy, AnActionThatIsNotFiniteIsADataErrorThatNamesTheFile) {
  const TestFolder folder;
  TanhGaussianPolicy policy = MakePolicy();
  WriteOnnx(policy, {}, folder / "policy.onnx");
  const BatchPolicy act = LoadBatchPolicy(folder / "policy.onnx", PointMass::MakeSpec({}));
  std::vector<double> action(1);
  const std::string message = MessageOf<DataError>([&] { act(std::vector<double>{NAN, 0}, 1, action); });
  EXPECT_NE(message.find("policy.onnx"), std::string::npos);
}

}  // namespace oted::batch_policy_test
