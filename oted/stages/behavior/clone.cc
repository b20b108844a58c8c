#include "oted/stages/behavior/clone.h"

#include "oted/stages/behavior/behavioral_cloning.h"
#include "oted/stages/behavior/clone_choice.h"
#include "oted/stages/behavior/value_dice.h"

namespace oted {

CloneResult CloneBehavior(const Dataset& dataset, const SimulatorSpec& spec, const CloneConfig& config, RngKey key,
                          const std::string& run_name, const RunContext& context, const SimulatorFactory* nominal) {
  dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  const std::string method = config.MethodFor(spec);
  if (method == "auto") return ChooseClone(dataset, spec, config, key, run_name, context, nominal);
  if (method == "valuedice") return CloneByValueDice(dataset, spec, config, key, run_name, context);
  return CloneByLikelihood(dataset, spec, config, key, run_name, context);
}

}  // namespace oted
