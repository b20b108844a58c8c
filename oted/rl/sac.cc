#include "oted/rl/sac.h"

#include <utility>

#include "oted/base/sizes.h"
#include "oted/rl/autograd/on_device.h"
#include "oted/rl/sac_update.h"

namespace oted {

FieldList SacConfig::Fields() {
  FieldList fields("sac");
  AddFields(fields);
  fields.Add("hidden", &hidden, "widths of the hidden layers of actor and critics", LayerWidths());
  fields.Add("normalize_observations", &normalize_observations,
             "actor and critics see observations in units of their running mean and spread");
  fields.Add("tau", &tau, "Polyak step of the target critics", AboveUpTo(0, 1));
  return fields;
}

ReplayAgent TrainAgent(const AgentJob& job, const SacConfig& config) {
  const auto make_update = [&](TanhGaussianPolicy actor, Rng& rng) -> std::unique_ptr<ReplayUpdate> {
    actor.net().Initialize(rng);
    const SacUpdateOptions options{.learning_rate = config.learning_rate,
                                   .tau = config.tau,
                                   .target_entropy = -static_cast<double>(actor.act_dim())};
    SacUpdate update(std::move(actor), config.hidden, options, rng);
    if (config.device != TrainingDevice::kCpu) return OnDevice(std::move(update), options, config.device);
    return std::make_unique<SacUpdate>(std::move(update));
  };
  return TrainByReplay(job, config, "sac", make_update);
}

}  // namespace oted
