#include "oted/rl/batch_policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/nn/categorical.h"
#include "oted/nn/categorical_policy.h"
#include "oted/nn/onnx_policy.h"

namespace oted {

BatchPolicy AsBatchPolicy(const Policy& policy, ActionNoise noise, Rng rng) {
  struct State {
    std::unique_ptr<PolicyActor> actor;
    Rng rng;
  };
  // A std::function is copied; the stream must not be.
  const auto state = std::make_shared<State>(policy.MakeActor(noise), rng);
  BatchPolicy act = [state](std::span<const double> observations, int n, std::span<double> actions) {
    state->actor->Act(observations, n, state->rng, actions);
  };
  act.begin = [state](int n) { state->actor->Begin(n); };
  act.keep = [state](std::span<const int> rows) { state->actor->Keep(rows); };
  return act;
}

namespace {

/// `act` in the place of `inner`, whose memory it has.
BatchPolicy InPlaceOf(const BatchPolicy& inner, BatchPolicy act) {
  act.begin = inner.begin;
  act.keep = inner.keep;
  return act;
}

}  // namespace

BatchPolicy MeanActionPolicy(const Policy& policy) { return AsBatchPolicy(policy, ActionNoise::kMean, Rng(0)); }

namespace {

void CheckFits(const std::filesystem::path& path, int obs_dim, int act_dim, const SimulatorSpec& spec) {
  if (obs_dim == spec.obs_dim() && act_dim == spec.act_dim) return;
  throw DataError(
      fmt::format("policy '{}' maps {} observations to {} actions, task '{}' has {} and {}; name a policy of this task",
                  path.string(), obs_dim, act_dim, spec.task, spec.obs_dim(), spec.act_dim));
}

BatchPolicy LoadNpz(const std::filesystem::path& path, const SimulatorSpec& spec, ActionNoise discrete, Rng rng) {
  const std::shared_ptr<const Policy> policy = LoadPolicy(path);
  CheckFits(path, policy->obs_dim(), policy->act_dim(), spec);
  const auto* categorical = dynamic_cast<const CategoricalPolicy*>(policy.get());
  const int n_actions = categorical == nullptr ? 0 : categorical->n_actions();
  if (n_actions != spec.n_discrete_actions) {
    const auto kind = [](int n) { return n == 0 ? std::string("continuous") : fmt::format("{} discrete", n); };
    throw DataError(fmt::format("policy '{}' has {} actions, task '{}' has {} ones; name a policy of this task",
                                path.string(), kind(n_actions), spec.task, kind(spec.n_discrete_actions)));
  }
  const ActionNoise noise = categorical == nullptr ? ActionNoise::kMean : discrete;
  const BatchPolicy act = AsBatchPolicy(*policy, noise, rng);
  return InPlaceOf(act, [policy, act](std::span<const double> observations, int n, std::span<double> actions) {
    act(observations, n, actions);
  });
}

BatchPolicy LoadOnnx(const std::filesystem::path& path, const SimulatorSpec& spec, ActionNoise discrete, Rng rng) {
  const bool is_discrete = spec.n_discrete_actions > 0, sampled = is_discrete && discrete == ActionNoise::kSampled;
  const auto policy = std::make_shared<OnnxPolicy>(OnnxPolicy::Load(path, sampled ? "logits" : "action"));
  const int obs_dim = policy->obs_dim() > 0 ? policy->obs_dim() : spec.obs_dim();
  const int width = policy->Evaluate(std::vector<double>(2 * static_cast<size_t>(obs_dim)), 2).cols;
  // With one number for each action they are logits.
  const bool has_logits = is_discrete && width > 1 && width == spec.n_discrete_actions;
  CheckFits(path, obs_dim, has_logits ? 1 : width, spec);
  return [policy, has_logits, sampled, rng](std::span<const double> observations, int n,
                                            std::span<double> actions) mutable {
    const OnnxValue output = policy->Evaluate(observations, n);
    if (!has_logits) {
      OTED_CHECK(output.data.size() == actions.size());
      std::copy(output.data.begin(), output.data.end(), actions.begin());
      return;
    }
    const auto n_actions = static_cast<size_t>(output.cols);
    OTED_CHECK(output.data.size() == actions.size() * n_actions);
    for (size_t i = 0; i < actions.size(); ++i) {
      const std::span<const float> logits(output.data.data() + i * n_actions, n_actions);
      actions[i] = std::ranges::all_of(logits, [](float v) { return std::isfinite(v); })
                       ? (sampled ? SampleCategorical(logits, rng) : MostProbable(logits))
                       : std::numeric_limits<double>::quiet_NaN();
    }
  };
}

}  // namespace

BatchPolicy LoadBatchPolicy(const std::filesystem::path& path, const SimulatorSpec& spec, ActionNoise discrete,
                            Rng rng) {
  const std::string ending = path.extension().string();
  if (ending != ".npz" && ending != ".onnx") {
    throw DataError(fmt::format("policy '{}' ends in '{}', wanted .npz or .onnx", path.string(), ending));
  }
  const BatchPolicy act = ending == ".npz" ? LoadNpz(path, spec, discrete, rng) : LoadOnnx(path, spec, discrete, rng);
  const int n_actions = spec.n_discrete_actions;
  return InPlaceOf(act, [act, n_actions, name = path.string()](std::span<const double> observations, int n,
                                                               std::span<double> actions) {
    act(observations, n, actions);
    for (const double a : actions) {
      if (!std::isfinite(a)) {
        throw DataError(fmt::format("policy '{}' gives an action that is not finite; train or export it again", name));
      }
      if (n_actions > 0 && !(a >= 0 && a < n_actions && a == std::floor(a))) {
        throw DataError(
            fmt::format("policy '{}' gives action {}, wanted an index 0, ..., {}; name a policy of this task", name, a,
                        n_actions - 1));
      }
    }
  });
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
