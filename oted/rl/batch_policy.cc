#include "oted/rl/batch_policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/nn/onnx_policy.h"

namespace oted {

BatchPolicy AsBatchPolicy(const Policy& policy, ActionNoise noise, Rng rng) {
  struct State {
    std::unique_ptr<PolicyActor> actor;
    Rng rng;
  };
  // A std::function is copied; the stream must not be.
  const auto state = std::make_shared<State>(policy.MakeActor(noise), rng);
  return [state](std::span<const double> observations, int n, std::span<double> actions) {
    state->actor->Act(observations, n, state->rng, actions);
  };
}

BatchPolicy MeanActionPolicy(const Policy& policy) { return AsBatchPolicy(policy, ActionNoise::kMean, Rng(0)); }

namespace {

void CheckFits(const std::filesystem::path& path, int obs_dim, int act_dim, const SimulatorSpec& spec) {
  if (obs_dim == spec.obs_dim() && act_dim == spec.act_dim) return;
  throw DataError(
      fmt::format("policy '{}' maps {} observations to {} actions, task '{}' has {} and {}; name a policy of this task",
                  path.string(), obs_dim, act_dim, spec.task, spec.obs_dim(), spec.act_dim));
}

BatchPolicy LoadNpz(const std::filesystem::path& path, const SimulatorSpec& spec) {
  const std::shared_ptr<const Policy> policy = LoadPolicy(path);
  CheckFits(path, policy->obs_dim(), policy->act_dim(), spec);
  return [policy, act = MeanActionPolicy(*policy)](std::span<const double> observations, int n,
                                                   std::span<double> actions) { act(observations, n, actions); };
}

BatchPolicy LoadOnnx(const std::filesystem::path& path, const SimulatorSpec& spec) {
  const auto policy = std::make_shared<OnnxPolicy>(OnnxPolicy::Load(path));
  const int obs_dim = policy->obs_dim() > 0 ? policy->obs_dim() : spec.obs_dim();
  const int act_dim = policy->Evaluate(std::vector<double>(2 * static_cast<size_t>(obs_dim)), 2).cols;
  CheckFits(path, obs_dim, act_dim, spec);
  return [policy](std::span<const double> observations, int n, std::span<double> actions) {
    const OnnxValue output = policy->Evaluate(observations, n);
    OTED_CHECK(output.data.size() == actions.size());
    std::copy(output.data.begin(), output.data.end(), actions.begin());
  };
}

}  // namespace

BatchPolicy LoadBatchPolicy(const std::filesystem::path& path, const SimulatorSpec& spec) {
  const std::string ending = path.extension().string();
  if (ending != ".npz" && ending != ".onnx") {
    throw DataError(fmt::format("policy '{}' ends in '{}', wanted .npz or .onnx", path.string(), ending));
  }
  const BatchPolicy act = ending == ".npz" ? LoadNpz(path, spec) : LoadOnnx(path, spec);
  return [act, name = path.string()](std::span<const double> observations, int n, std::span<double> actions) {
    act(observations, n, actions);
    if (!std::all_of(actions.begin(), actions.end(), [](double a) { return std::isfinite(a); })) {
      throw DataError(fmt::format("policy '{}' gives an action that is not finite; train or export it again", name));
    }
  };
}

OnnxMetadata PolicyMetadata(const SimulatorSpec& spec, const std::string& source) {
  return {{"task", spec.task},
          {"observation_names", nlohmann::json(spec.observation_names).dump()},
          {"action_names", nlohmann::json(spec.action_names).dump()},
          {"control_period_s", fmt::format("{}", spec.control_period_s)},
          {"oted_version", OTED_VERSION},
          {"source", source}};
}

}  // namespace oted
