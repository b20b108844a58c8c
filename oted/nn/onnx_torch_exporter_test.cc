// The truth is torch: what its exporter makes of a module gives the module's own numbers.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/nn/onnx_policy.h"

namespace oted::onnx_torch_exporter_test {

double Worst(const OnnxValue& actions, const std::vector<double>& expected) {
  double worst = actions.data.size() == expected.size() ? 0 : INFINITY;
  for (size_t i = 0; i < expected.size() && i < actions.data.size(); ++i) {
    const double difference =
        std::abs(static_cast<double>(actions.data[i]) - expected[i]) / (1 + std::abs(expected[i]));
    if (!(difference <= worst)) worst = difference;
  }
  return worst;
}

TEST(OnnxPolicy, ReadsWhatTorchExportsOfAnActor) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(R"(
import numpy as np, torch, onnxruntime
torch.manual_seed(0)
observations = np.random.default_rng(1).normal(size=(5, 11)).astype(np.float32)
# Actors as Stable-Baselines3's SAC and PPO have them, and one with a normaliser and two heads.
sac = torch.nn.Sequential(torch.nn.Flatten(), torch.nn.Linear(11, 64), torch.nn.ReLU(), torch.nn.Linear(64, 64),
                          torch.nn.ReLU(), torch.nn.Linear(64, 3), torch.nn.Tanh())
ppo = torch.nn.Sequential(torch.nn.Flatten(), torch.nn.Linear(11, 32), torch.nn.Tanh(), torch.nn.Linear(32, 3))
class Normalised(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.register_buffer("mean", torch.randn(11))
        self.register_buffer("var", torch.rand(11) + 0.1)
        self.net = torch.nn.Sequential(torch.nn.Linear(11, 16), torch.nn.ELU(), torch.nn.Linear(16, 6))
    def forward(self, x):
        x = torch.clamp((x - self.mean) / torch.sqrt(self.var + 1e-8), -10.0, 10.0)
        y = self.net(x)
        return torch.tanh(y[:, :3]) * 0.4 + 0.1, y[:, 3:]
expected = {}
for name, model in (("sac", sac), ("ppo", ppo), ("normalised", Normalised())):
    model.eval()
    torch.onnx.export(model, (torch.zeros(1, 11),), name + ".onnx", dynamo=False, input_names=["observation"])
    with torch.no_grad():
        y = model(torch.from_numpy(observations))
    expected[name] = (y[0] if isinstance(y, tuple) else y).numpy().astype(float)
np.savez("expected.npz", observations=observations.astype(float), **expected)
)",
                        folder));
  NpzArrays arrays = ReadNpz(folder / "expected.npz");
  const std::vector<double> observations = arrays.at("observations").ToDouble();
  for (const char* name : {"sac", "ppo", "normalised"}) {
    const OnnxPolicy policy = OnnxPolicy::Load(folder / (std::string(name) + ".onnx"));
    EXPECT_EQ(policy.obs_dim(), 11);
    EXPECT_LE(Worst(policy.Evaluate(observations, 5), arrays.at(name).ToDouble()), 1e-5) << name;
  }
}

}  // namespace oted::onnx_torch_exporter_test
