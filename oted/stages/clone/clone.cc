#include "oted/stages/clone/clone.h"

#include "oted/stages/clone/behavioral_cloning.h"
#include "oted/stages/clone/clone_choice.h"
#include "oted/stages/clone/value_dice.h"

namespace oted {

CloneResult CloneBehavior(const CloneJob& job) {
  job.dataset.CheckFits(job.spec.task, job.spec.obs_dim(), job.spec.act_dim);
  switch (job.config.MethodFor(job.spec)) {
    case CloneMethod::kAuto:
      return ChooseClone(job);
    case CloneMethod::kValueDice:
      return CloneByValueDice(job);
    case CloneMethod::kBehavioralCloning:
      break;
  }
  return CloneByLikelihood(job);
}

}  // namespace oted
