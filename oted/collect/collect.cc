#include "oted/collect/collect.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/collect/demonstrations.h"
#include "oted/collect/excitation.h"
#include "oted/sim/task_policy.h"

namespace oted {
namespace {

/// `n` episodes of the policy that `name` stands for; the name is checked where there are none, too.
Dataset CollectNamed(const CollectJob& job, const std::string& name, int n, RngKey key) {
  const SimulatorSpec& spec = job.factory.spec();
  if (job.factory.has_expert()) {
    const TaskPolicy policy = TaskPolicyNamed(name);
    return n > 0 ? CollectTaskPolicy(job.factory, job.z, policy, n, key, job.n_threads) : Dataset();
  }
  if (const auto excitation = Excitation::Parse(name)) {
    return n > 0 ? CollectExcitation(job.factory, job.z, *excitation, n, key, job.n_threads) : Dataset();
  }
  if (name.ends_with(".onnx")) {
    throw UsageError(fmt::format("'{}' is an ONNX model, which 'oted evaluate' alone takes; name a policy.npz", name));
  }
  const TanhGaussianPolicy policy = TanhGaussianPolicy::Load(name);
  if (policy.obs_dim() != spec.obs_dim() || policy.act_dim() != spec.act_dim) {
    throw DataError(fmt::format(
        "policy '{}' maps {} observations to {} actions, task '{}' has {} and {}; name a policy of this task", name,
        policy.obs_dim(), policy.act_dim(), spec.task, spec.obs_dim(), spec.act_dim));
  }
  return n > 0 ? CollectDemonstrations(job.factory, job.z, policy, n, key, job.n_threads) : Dataset();
}

}  // namespace

Dataset Collect(const CollectJob& job) {
  Dataset dataset;
  const int n_policies = static_cast<int>(job.policies.size());
  for (int p = 0; p < n_policies; ++p) {
    // Two policies share the episodes; the later one takes what is odd: medium-expert is two medium and three expert.
    const int n = job.n_episodes * (p + 1) / n_policies - job.n_episodes * p / n_policies;
    const Dataset logs =
        CollectNamed(job, job.policies[static_cast<size_t>(p)], n, job.key.Index(static_cast<uint64_t>(p)));
    if (logs.size() > 0) dataset.Append(logs);
  }
  const SimulatorSpec& spec = job.factory.spec();
  dataset.period_s = spec.control_period_s;
  dataset.observation_names = spec.observation_names;
  dataset.action_names = spec.action_names;
  return dataset;
}

WriteOptions WriteOptionsFor(const SimulatorSpec& spec, const std::string& environment) {
  WriteOptions write;
  write.environment = environment;
  write.action_low = spec.action_low;
  write.action_high = spec.action_high;
  write.n_discrete_actions = spec.n_discrete_actions;
  if (!spec.image_shape.empty() && !spec.observation_levels.empty()) {
    write.image_shape = spec.image_shape;
    write.index_name = "direction";  // as Minigrid's own observations call it
    write.n_index = spec.observation_levels.back();
  }
  return write;
}

}  // namespace oted
