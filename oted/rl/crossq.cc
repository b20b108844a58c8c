#include "oted/rl/crossq.h"

#include <utility>

#include "oted/base/sizes.h"
#include "oted/rl/autograd/on_device.h"
#include "oted/rl/crossq_update.h"

namespace oted {

FieldList CrossQConfig::Fields() {
  FieldList fields("crossq");
  AddFields(fields);
  fields.Add("hidden", &hidden, "widths of the actor's hidden layers", LayerWidths());
  fields.Add("critic_hidden", &critic_hidden, "widths of the critics' hidden layers", LayerWidths());
  fields.Add("beta1", &beta1, "Adam's decay of the gradient's mean, for actor and critics", Between(0, 0.999));
  fields.Add("policy_delay", &policy_delay, "gradient steps of the critics for one of actor and temperature",
             AtLeast(1));
  fields.Add("momentum", &momentum, "step of the running statistics towards a batch's", AboveUpTo(0, 1));
  fields.Add("renorm_warmup", &renorm_warmup,
             "gradient steps normalised by the batch alone, before batch renormalisation begins", AtLeast(0));
  return fields;
}

ReplayAgent TrainAgent(const AgentJob& job, const CrossQConfig& config) {
  const auto make_update = [&](const TanhGaussianPolicy& actor, Rng& rng) -> std::unique_ptr<ReplayUpdate> {
    const CrossQUpdateOptions options{.learning_rate = config.learning_rate,
                                      .beta1 = config.beta1,
                                      .target_entropy = -static_cast<double>(actor.act_dim()),
                                      .policy_delay = config.policy_delay,
                                      .momentum = config.momentum,
                                      .renorm_warmup = config.renorm_warmup};
    CrossQUpdate update(actor, config.critic_hidden, options, rng);
    if (config.device != TrainingDevice::kCpu) return OnDevice(std::move(update), options, config.device);
    return std::make_unique<CrossQUpdate>(std::move(update));
  };
  return TrainByReplay(job, config, "crossq", make_update);
}

}  // namespace oted
