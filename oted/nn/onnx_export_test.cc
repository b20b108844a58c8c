// The truths: onnx's own checker, onnxruntime, and PolicyRunner.

#include "oted/nn/onnx_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/nn/onnx_policy.h"

namespace oted::onnx_export_test {

/// Checks model.onnx and runs it on each array of observations.npz; into actions.npz go <name>/<output>.
constexpr const char* kRun = R"(
import numpy as np, onnx, onnxruntime
model = onnx.load("model.onnx")
onnx.checker.check_model(model, full_check=True)
session = onnxruntime.InferenceSession("model.onnx", providers=["CPUExecutionProvider"])
names = [o.name for o in session.get_outputs()]
assert [i.name for i in session.get_inputs()] == ["observation"], session.get_inputs()
assert names == ["action", "mean", "log_std"], names
assert session.get_inputs()[0].shape[0] == "batch" and session.get_outputs()[0].shape[0] == "batch"
out = {}
for name, observations in np.load("observations.npz").items():
    for output, value in zip(names, session.run(None, {"observation": observations.astype(np.float32)})):
        assert value.dtype == np.float32
        out[name + "_" + output] = value
np.savez("actions.npz", **out)
metadata = session.get_modelmeta().custom_metadata_map
assert metadata["task"] == "Mine-v0" and metadata["note"] == 'a "quoted" name, und Umlaute: äöü', metadata
import json
assert json.loads(metadata["action_low"]) == [-1.0, -3.0, 0.5], metadata
assert json.loads(metadata["action_high"]) == [1.0, 5.0, 0.75], metadata
)";

const OnnxMetadata kMetadata = {{"task", "Mine-v0"}, {"note", "a \"quoted\" name, und Umlaute: äöü"}};

/// 4 observations, 3 actions of unequal ranges.
TanhGaussianPolicy MakePolicy(const Normalizer& normalizer, const std::vector<int>& hidden) {
  TanhGaussianPolicy policy(normalizer, hidden, {-1, -3, 0.5}, {1, 5, 0.75});
  Rng rng(1);
  policy.net().Initialize(rng);
  // Larger than at the start of training: saturated, clamped and ordinary outputs all occur.
  for (float& p : policy.net().parameters()) p *= 3;
  return policy;
}

/// Rounded to float32, which is what a user of the file hands over.
Array2<double> Observations(int n, double scale, const Normalizer& normalizer) {
  Rng rng(static_cast<uint64_t>(n));
  Array2<double> rows(n, 4);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 4; ++j) {
      const size_t k = static_cast<size_t>(j);
      rows(i, j) =
          static_cast<double>(static_cast<float>(normalizer.mean[k] + scale * normalizer.scale[k] * rng.Normal()));
    }
  }
  return rows;
}

std::vector<double> MeanActions(const TanhGaussianPolicy& policy, const Array2<double>& observations) {
  PolicyRunner runner(policy, ActionNoise::kMean);
  Rng unused(0);
  std::vector<double> actions(static_cast<size_t>(observations.rows() * policy.act_dim()));
  runner.Act(observations.values(), observations.rows(), unused, actions);
  return actions;
}

class OnnxExport : public testing::TestWithParam<std::pair<Normalizer, std::vector<int>>> {};

TEST_P(OnnxExport, OnnxruntimeGivesThePolicysActions) {
  const auto& [normalizer, hidden] = GetParam();
  const TanhGaussianPolicy policy = MakePolicy(normalizer, hidden);
  std::map<std::string, Array2<double>> cases = {{"one", Observations(1, 1, normalizer)},
                                                 {"two", Observations(2, 1, normalizer)},
                                                 {"seven", Observations(7, 2, normalizer)},
                                                 {"many", Observations(257, 1, normalizer)},
                                                 {"far", Observations(64, 1e3, normalizer)},
                                                 {"farther", Observations(64, 1e8, normalizer)},
                                                 {"farthest", Observations(64, 1e20, normalizer)},
                                                 {"near", Observations(16, 1e-20, normalizer)},
                                                 {"zero", Array2<double>(3, 4)}};
  const TestFolder folder;
  NpzArrays observations;
  for (const auto& [name, rows] : cases) observations[name] = NpyArray(rows);
  WriteNpz(observations, folder / "observations.npz");
  WriteOnnx(policy, kMetadata, folder / "model.onnx");
  ASSERT_TRUE(RunPython(kRun, folder));

  const NpzArrays results = ReadNpz(folder / "actions.npz");
  const OnnxPolicy own = OnnxPolicy::Load(folder / "model.onnx");
  EXPECT_EQ(own.obs_dim(), 4);
  EXPECT_EQ(own.metadata().at("note"), kMetadata.at("note"));
  double worst = 0, worst_own = 0;
  for (const auto& [name, rows] : cases) {
    const std::vector<double> expected = MeanActions(policy, rows), actions = results.at(name + "_action").ToDouble(),
                              mean = results.at(name + "_mean").ToDouble(),
                              log_std = results.at(name + "_log_std").ToDouble();
    ASSERT_EQ(actions.size(), expected.size());
    const OnnxValue ours = own.Evaluate(rows.values(), rows.rows());
    ASSERT_EQ(ours.data.size(), expected.size());
    std::vector<float> input(rows.values().size());
    policy.NormalizeObservations(rows.values(), input);
    MlpPass pass;
    const float* head = pass.Forward(policy.net(), input.data(), rows.rows());
    for (size_t i = 0; i < expected.size(); ++i) {
      worst = std::max(worst, std::abs(actions[i] - expected[i]));
      worst_own = std::max(worst_own, std::abs(static_cast<double>(ours.data[i]) - expected[i]));
      const double u = head[i / 3 * 6 + i % 3], s = head[i / 3 * 6 + 3 + i % 3];
      EXPECT_NEAR(mean[i], u, 1e-5 * std::max(1.0, std::abs(u))) << name;
      EXPECT_NEAR(log_std[i], std::clamp(s, -20.0, 2.0), 1e-4) << name;
    }
  }
  std::printf("largest difference: onnxruntime %.2g, own reader %.2g\n", worst, worst_own);
  EXPECT_LE(worst, 1e-5);
  EXPECT_LE(worst_own, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(
    Policies, OnnxExport,
    testing::Values(std::pair(Normalizer{{0, 0, 0, 0}, {1, 1, 1, 1}}, std::vector<int>{16, 8}),
                    std::pair(Normalizer{{0, 0, 0, 0}, {1, 1, 1, 1}}, std::vector<int>{}),
                    std::pair(Normalizer{{1, -2, 0.5, 0}, {2, 0.5, 1, 3}}, std::vector<int>{256, 256}),
                    // A mean far from zero beside a small scale: float32 alone would round it away.
                    std::pair(Normalizer{{1.2345678, -98.7654321, 0.1, 3}, {1e-2, 1.0, 1e-3, 1e3}},
                              std::vector<int>{8})));

TEST(OnnxBytes, EqualPoliciesGiveEqualBytesAndOthersDoNot) {
  const Normalizer normalizer{{1, -2, 0.5, 0}, {2, 0.5, 1, 3}};
  TanhGaussianPolicy policy = MakePolicy(normalizer, {5});
  const std::string bytes = OnnxBytes(policy, kMetadata);
  EXPECT_EQ(OnnxBytes(MakePolicy(normalizer, {5}), kMetadata), bytes);
  EXPECT_NE(OnnxBytes(policy, {}), bytes);
  policy.net().parameters()[3] += 1;
  EXPECT_NE(OnnxBytes(policy, kMetadata), bytes);
}

}  // namespace oted::onnx_export_test
