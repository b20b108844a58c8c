#include "oted/nn/tanh_gaussian.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"

namespace oted::tanh_gaussian_test {

/// 3 observations, 2 actions with unequal ranges.
TanhGaussianPolicy MakePolicy(const std::vector<int>& hidden = {8}) {
  TanhGaussianPolicy policy(Normalizer{{1, -2, 0.5}, {2, 0.5, 1}}, hidden, {-1, -3}, {1, 5});
  Rng rng(1);
  policy.net().Initialize(rng);
  return policy;
}

std::vector<double> Act(const TanhGaussianPolicy& policy, ActionNoise noise, const std::vector<double>& observations,
                        double noise_scale = 1.0) {
  PolicyRunner runner(policy, noise, noise_scale);
  Rng rng(2);
  const size_t n = observations.size() / 3;
  std::vector<double> actions(2 * n);
  runner.Act(observations, static_cast<int>(n), rng, actions);
  return actions;
}

TEST(TanhGaussianPolicy, SavedAndLoadedItActsTheSame) {
  const TestFolder folder;
  for (const std::vector<int>& hidden : {std::vector<int>{8}, std::vector<int>{}, std::vector<int>{16, 5}}) {
    const TanhGaussianPolicy policy = MakePolicy(hidden);
    policy.Save(folder / "policy.npz");
    const TanhGaussianPolicy loaded = TanhGaussianPolicy::Load(folder / "policy.npz");
    const std::vector<double> observations = {0.3, -1, 2, 5, 0, -0.2};
    EXPECT_EQ(Act(policy, ActionNoise::kSampled, observations), Act(loaded, ActionNoise::kSampled, observations));
    EXPECT_EQ(Act(policy, ActionNoise::kMean, observations), Act(loaded, ActionNoise::kMean, observations));
    EXPECT_EQ(loaded.net().hidden(), hidden);
  }
}

TEST(TanhGaussianPolicy, SampledActionsHaveTheNetworksMeanAndDeviation) {
  TanhGaussianPolicy policy = MakePolicy({});
  // Without hidden layers the network is affine: mean and log std of this state are known.
  auto& p = policy.net().parameters();
  std::fill(p.begin(), p.end(), 0.0f);
  const std::vector<double> state = {3, -1, 2};  // normalised: (1, 2, 1.5)
  const float weights[3][4] = {{0.2f, 0, -0.5f, 0}, {0, -0.1f, 0, 0.1f}, {0.1f, 0, 0, 0}};
  const float bias[4] = {0.1f, 0.4f, -0.2f, -1.2f};
  for (size_t i = 0; i < 3; ++i) std::copy_n(weights[i], 4, p.begin() + static_cast<ptrdiff_t>(4 * i));
  std::copy_n(bias, 4, p.begin() + 12);
  const double mean[2] = {0.1 + 0.2 + 0.15, 0.4 - 0.2}, std[2] = {std::exp(-0.7), std::exp(-1.0)};

  const std::vector<double> deterministic = Act(policy, ActionNoise::kMean, state);
  EXPECT_NEAR(deterministic[0], std::tanh(mean[0]), 1e-6);
  EXPECT_NEAR(deterministic[1], 1 + 4 * std::tanh(mean[1]), 1e-6);

  constexpr int kN = 40000;
  std::vector<double> states;
  for (int i = 0; i < kN; ++i) states.insert(states.end(), state.begin(), state.end());
  for (const double scale : {1.0, 0.5}) {
    const std::vector<double> actions = Act(policy, ActionNoise::kSampled, states, scale);
    for (int j = 0; j < 2; ++j) {
      double sum = 0, squares = 0;
      for (int i = 0; i < kN; ++i) {
        const double u = policy.UnsquashAction(actions[static_cast<size_t>(2 * i + j)], j);
        sum += u;
        squares += u * u;
      }
      const double m = sum / kN, s = std::sqrt(squares / kN - m * m);
      // Five standard errors.
      EXPECT_NEAR(m, mean[j], 5 * scale * std[j] / std::sqrt(kN));
      EXPECT_NEAR(s, scale * std[j], 5 * scale * std[j] / std::sqrt(2.0 * kN));
    }
  }
}

TEST(TanhGaussianPolicy, SquashAndUnsquashAreInverseAndStayInside) {
  const TanhGaussianPolicy policy = MakePolicy();
  for (int j = 0; j < 2; ++j) {
    for (double u = -5; u <= 5; u += 0.25) EXPECT_NEAR(policy.UnsquashAction(policy.SquashAction(u, j), j), u, 1e-9);
  }
  EXPECT_EQ(policy.SquashAction(0, 1), 1.0);
  EXPECT_EQ(policy.SquashAction(100, 1), 5.0);
  EXPECT_EQ(policy.SquashAction(-100, 1), -3.0);
  for (const double a : {-3.0, 5.0, 7.0, -100.0}) EXPECT_LT(std::abs(policy.UnsquashAction(a, 1)), 6.2);
}

TEST(TanhGaussianPolicy, AForeignOrDamagedFileIsADataError) {
  const TestFolder folder;
  const std::string path = folder / "policy.npz";
  const auto load_error = [&](const std::function<void(NpzArrays&)>& damage) {
    MakePolicy().Save(path);
    NpzArrays arrays = ReadNpz(path);
    damage(arrays);
    WriteNpz(arrays, path);
    return MessageOf<DataError>([&] { TanhGaussianPolicy::Load(path); });
  };
  EXPECT_NE(load_error([](NpzArrays& a) {
              a = {{"observations", NpyArray(std::vector<double>{1, 2})}};
            }).find(path),
            std::string::npos);
  for (const char* name :
       {"parameters", "hidden", "observation_mean", "observation_scale", "action_low", "action_high"}) {
    SCOPED_TRACE(name);
    load_error([&](NpzArrays& a) { a.erase(name); });
    load_error([&](NpzArrays& a) { a[name] = NpyArray(std::vector<double>{}); });
    load_error([&](NpzArrays& a) { a[name] = NpyArray(std::vector<double>{-1, NAN, 1, 1, 1}); });
  }
  WriteFileAtomically(path, "not a policy");
  MessageOf<DataError>([&] { TanhGaussianPolicy::Load(path); });
  MessageOf<DataError>([&] { TanhGaussianPolicy::Load(folder / "absent.npz"); });
}

}  // namespace oted::tanh_gaussian_test
