#include "oted/stages/clone/clone_config.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/base/sizes.h"

namespace oted {

const NamedValues<CloneMethod>& CloneMethodNames() {
  static const NamedValues<CloneMethod> names = {
      {CloneMethod::kBehavioralCloning, "bc"}, {CloneMethod::kValueDice, "valuedice"}, {CloneMethod::kAuto, "auto"}};
  return names;
}

FieldList CloneConfig::Fields() {
  FieldList fields("clone");
  fields.AddChoice(
      "method", &method,
      "how to imitate the logs: behavioural cloning (bc), ValueDICE, or the better of both on held-out episodes (auto)",
      CloneMethodNames());
  fields.Add("hidden", &hidden, "widths of the policy's hidden layers", LayerWidths());
  fields.Add("filters", &filters, "filters of the 3x3 convolutions before them; only for images", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size", Above(0));
  fields.Add("weight_decay", &weight_decay, "L2 penalty added to the gradient", AtLeast(0));
  fields.Add("batch_size", &batch_size, "transitions per gradient step", BatchSizes());
  fields.Add("max_steps", &max_steps, "gradient steps at most", AtLeast(1));
  fields.Add("held_out", &held_out, "fraction of the transitions held out for early stopping", Between(0.01, 0.5));
  fields.Add("patience", &patience, "stop after this many checks without a better held-out loss", AtLeast(1));
  fields.Add("check_interval", &check_interval, "gradient steps between checks of the held-out loss", AtLeast(1));
  fields.AddChoice("valuedice_start", &valuedice_start,
                   "of valuedice: the first policy, the behavioural clone or random weights",
                   NamedValues<ValueDiceStart>{{ValueDiceStart::kBehavioralClone, "bc"},
                                               {ValueDiceStart::kRandomWeights, "random"}});
  fields.Add("valuedice_updates", &valuedice_updates, "of valuedice: updates of critic and policy", AtLeast(1));
  fields.Add("valuedice_batch", &valuedice_batch, "of valuedice: transitions per update", AtLeast(2));
  fields.Add("valuedice_hidden", &valuedice_hidden, "of valuedice: widths of the critic's hidden layers",
             LayerWidths());
  fields.Add("valuedice_actor_rate", &valuedice_actor_rate, "of valuedice: Adam's step size for the policy", Above(0));
  fields.Add("valuedice_critic_rate", &valuedice_critic_rate, "of valuedice: Adam's step size for the critic",
             Above(0));
  fields.Add("valuedice_discount", &valuedice_discount, "of valuedice: discount per control step",
             {.low = 0, .high = 1, .high_open = true});
  fields.Add("valuedice_penalty", &valuedice_penalty, "of valuedice: weight of the critic's gradient penalty",
             AtLeast(0));
  fields.Add("valuedice_orthogonal", &valuedice_orthogonal,
             "of valuedice: weight of the penalty that keeps the policy's layers orthogonal", AtLeast(0));
  return fields;
}

ValueDiceOptions CloneConfig::ValueDice() const {
  return {.actor_learning_rate = valuedice_actor_rate,
          .critic_learning_rate = valuedice_critic_rate,
          .gamma = valuedice_discount,
          .gradient_penalty = valuedice_penalty,
          .orthogonal = valuedice_orthogonal};
}

CloneMethod CloneConfig::MethodFor(const SimulatorSpec& spec) const {
  const bool fits = spec.n_discrete_actions == 0 && spec.image_shape.empty();
  if (fits) return method;
  if (method == CloneMethod::kValueDice) {
    throw UsageError(fmt::format(
        "clone.method is valuedice, which takes continuous actions and no images; task '{}' has {}; set it to bc",
        spec.task, spec.n_discrete_actions > 0 ? "discrete actions" : "images"));
  }
  return CloneMethod::kBehavioralCloning;
}

}  // namespace oted
