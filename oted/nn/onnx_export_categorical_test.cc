// The truths: onnx's own checker, onnxruntime, and the policy's own network.

#include "oted/nn/onnx_export_categorical.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/nn/onnx_export.h"
#include "oted/nn/onnx_policy.h"

namespace oted::onnx_export_categorical_test {

/// Checks every NAME.onnx and runs it on NAME.npz; into results.npz go <name>_action and <name>_logits.
constexpr const char* kRun = R"(
import glob, numpy as np, onnx, onnxruntime
results = {}
for path in sorted(glob.glob("*.onnx")):
    name = path[:-5]
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    assert [i.name for i in session.get_inputs()] == ["observation"]
    assert [o.name for o in session.get_outputs()] == ["action", "logits"]
    observations = np.load(name + ".npz")["observations"]
    one = session.run(None, {"observation": observations[:1].astype(np.float32)})
    action, logits = session.run(None, {"observation": observations.astype(np.float32)})
    assert action.dtype == np.int64 and action.shape == (len(observations), 1), action.shape
    assert logits.dtype == np.float32 and one[1].shape == (1, logits.shape[1])
    assert session.get_modelmeta().custom_metadata_map["n_actions"] == str(logits.shape[1])
    results[name + "_action"], results[name + "_logits"] = action.astype(float), logits.astype(float)
np.savez("results.npz", **results)
)";

struct Case {
  std::string name;
  InputShape shape;
  NetSize size;
  float bound = 0;
  int obs_dim = 0;
};

/// What a policy may look at: levels per number, 0 for a quantity.
std::vector<Case> Cases() {
  const auto repeat = [](int n, const std::vector<int>& unit, const std::vector<int>& more) {
    std::vector<int> levels;
    for (int i = 0; i < n; ++i) levels.insert(levels.end(), unit.begin(), unit.end());
    levels.insert(levels.end(), more.begin(), more.end());
    return levels;
  };
  std::vector<Case> cases = {
      {"vector", {}, {{16, 8}, {}, false}, 10, 5},
      {"linear", {}, {{}, {}, false}, 0, 3},
      {"mixed_vector", {{}, {0, 0, 3, 4, 0}}, {{8}, {}, false}, 10, 5},
      {"grid", {{7, 7, 3}, repeat(49, {11, 6, 4}, {4})}, {{32, 16}, {8, 12}, false}, 10, 148},
      {"tall_grid", {{6, 4, 2}, repeat(24, {5, 1}, {})}, {{16}, {8}, false}, 10, 48},
      {"pixels", {{5, 6, 3}, repeat(30, {0, 0, 0}, {0, 0})}, {{16}, {6, 4}, false}, 10, 92},
      {"mixed_image", {{5, 5, 2}, repeat(25, {0, 4}, {0, 3, 0})}, {{8}, {6}, true}, 2, 53},
      {"no_convolution", {{3, 3, 1}, repeat(9, {4}, {})}, {{8}, {}, false}, 0, 9},
  };
  return cases;
}

/// Indices up to `levels`, of which the last two of a long list are rare; quantities around 30.
std::vector<double> Row(const Case& c, Rng& rng, bool strange) {
  std::vector<double> row(static_cast<size_t>(c.obs_dim));
  for (size_t j = 0; j < row.size(); ++j) {
    const int levels = c.shape.levels.empty() ? 0 : c.shape.levels[j];
    if (levels == 0) {
      row[j] = static_cast<double>(static_cast<float>(30 + (strange ? 100 : 2) * rng.Normal()));
      continue;
    }
    const int n = strange ? levels + 2 : std::max(1, levels - 2);
    row[j] = static_cast<double>(rng.Below(static_cast<uint64_t>(n))) - (strange ? 1 : 0);
    if (strange && rng.Uniform() < 0.1) row[j] += 0.5;
  }
  return row;
}

CategoricalPolicy MakePolicy(const Case& c) {
  Rng rng(3);
  Array2<double> rows;
  for (int i = 0; i < 60; ++i) rows.AppendRow(Row(c, rng, false));
  CategoricalPolicy policy(FeatureNet(Encoder(rows, c.shape), c.size, 4, c.bound));
  policy.net().Initialize(rng);
  for (float& p : policy.net().parameters()) p *= 2;
  return policy;
}

std::vector<double> Logits(const CategoricalPolicy& policy, const Array2<double>& rows) {
  FeaturePass pass;
  pass.Reserve(policy.net(), rows.rows());
  pass.Encode(policy.net(), rows, 0);
  const float* out = pass.Forward(policy.net());
  return std::vector<double>(out, out + static_cast<size_t>(rows.rows() * policy.n_actions()));
}

TEST(OnnxExportCategorical, OnnxruntimeAndOurReaderGiveThePolicysLogitsAndActions) {
  const TestFolder folder;
  std::map<std::string, Array2<double>> observations;
  for (const Case& c : Cases()) {
    WriteOnnx(MakePolicy(c), {{"task", "Mine-v0"}}, folder / (c.name + ".onnx"));
    Rng rng(4);
    Array2<double>& rows = observations[c.name];
    for (int i = 0; i < 40; ++i) rows.AppendRow(Row(c, rng, i % 2 == 1));
    WriteNpz({{"observations", NpyArray(rows)}}, folder / (c.name + ".npz"));
  }
  ASSERT_TRUE(RunPython(kRun, folder));
  const NpzArrays results = ReadNpz(folder / "results.npz");
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    const CategoricalPolicy policy = MakePolicy(c);
    const Array2<double>& rows = observations[c.name];
    const std::vector<double> expected = Logits(policy, rows), logits = results.at(c.name + "_logits").ToDouble(),
                              actions = results.at(c.name + "_action").ToDouble();
    const std::string path = folder / (c.name + ".onnx");
    const OnnxValue own = OnnxPolicy::Load(path, "logits").Evaluate(rows.values(), rows.rows());
    const OnnxValue own_actions = OnnxPolicy::Load(path).Evaluate(rows.values(), rows.rows());
    ASSERT_EQ(logits.size(), expected.size());
    ASSERT_EQ(own.data.size(), expected.size());
    ASSERT_EQ(own_actions.data.size(), actions.size());
    for (size_t i = 0; i < expected.size(); ++i) {
      const double tolerance = 1e-5 * std::max(1.0, std::abs(expected[i]));
      ASSERT_NEAR(logits[i], expected[i], tolerance) << i;
      ASSERT_NEAR(own.data[i], expected[i], tolerance) << i;
    }
    for (size_t i = 0; i < actions.size(); ++i) {
      const auto row = expected.begin() + static_cast<ptrdiff_t>(4 * i);
      EXPECT_EQ(actions[i], static_cast<double>(std::max_element(row, row + 4) - row)) << i;
      EXPECT_EQ(own_actions.data[i], actions[i]) << i;
    }
  }
}

TEST(OnnxExportCategorical, EqualPoliciesGiveEqualBytesAndOthersDoNot) {
  const Case c = Cases()[3];
  CategoricalPolicy policy = MakePolicy(c);
  const std::string bytes = OnnxBytes(policy, {});
  EXPECT_EQ(OnnxBytes(MakePolicy(c), {}), bytes);
  EXPECT_EQ(OnnxBytes(static_cast<const Policy&>(policy), {}), bytes);
  policy.net().parameters()[3] += 1;
  EXPECT_NE(OnnxBytes(policy, {}), bytes);
}

TEST(CategoricalPolicyFile, KeepsTheBoundOfItsQuantities) {
  const TestFolder folder;
  const Case c = Cases()[0];
  const CategoricalPolicy policy = MakePolicy(c);
  policy.Save(folder / "policy.npz");
  Array2<double> far;
  far.AppendRow(std::vector<double>(5, 1e4));
  EXPECT_EQ(Logits(CategoricalPolicy::Load(folder / "policy.npz"), far), Logits(policy, far));
  NpzArrays arrays = ReadNpz(folder / "policy.npz");
  arrays["categorical/bound"] = NpyArray(std::vector<float>{NAN});
  WriteNpz(arrays, folder / "policy.npz");
  MessageOf<DataError>([&] { CategoricalPolicy::Load(folder / "policy.npz"); });
}

}  // namespace oted::onnx_export_categorical_test
