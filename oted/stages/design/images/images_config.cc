#include "oted/stages/design/images/images_config.h"

namespace oted {

void SetImagesDefaults(AdversarialConfig& evidence, DiscriminatorConfig& g) {
  evidence.StartAtResets();
  evidence.evidence = SeenByG::kStateAction;
  evidence.horizon = 8;
  evidence.stack = 8;
  evidence.n_steps = 24;
  g.hidden = {64};
  g.learning_rate = 2e-3;
  g.steps = 30;
  g.batch = 128;
}

FieldList ImagesConfig::Fields() {
  FieldList fields("design.images");
  fields.Add("n_iterations", &n_iterations, "times that simulators are sampled and g is trained", AtLeast(1));
  fields.Add("n_sims", &n_sims, "simulators per iteration, z uniform over the bounds", AtLeast(2));
  fields.Add("replay_iterations", &replay_iterations, "iterations whose samples g is trained on", AtLeast(1));
  fields.Add("n_calibrations", &n_calibrations, "times that z is moved until simulator and logs get the same answer",
             AtLeast(0));
  return fields;
}

}  // namespace oted
