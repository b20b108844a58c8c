#include "oted/stages/design/design.h"

#include "oted/stages/design/design_method.h"

namespace oted {

DesignResult LearnDesign(const DesignProblem& problem, const DesignConfig& config) {
  config.Check();
  const SimulatorSpec& spec = problem.factory.spec();
  problem.dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  return Describe(config.method).learn(problem, config);
}

}  // namespace oted
