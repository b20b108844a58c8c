#pragma once
/// Settings of the design by a discriminator that is told z: [design.images].

#include "oted/base/fields.h"
#include "oted/matching/discriminator.h"
#include "oted/stages/design/adversarial/adversarial_config.h"

namespace oted {

/// What g is trained on is [design.adversarial]'s evidence, how, [design.discriminator]'s.
struct ImagesConfig {
  int n_iterations = 80;
  int n_sims = 128;
  int replay_iterations = 10;
  int n_calibrations = 2;

  FieldList Fields();
};

/// The defaults of the method `images`: the first steps of each episode as one sample, and a small network, as few
/// images have little to say.
void SetImagesDefaults(AdversarialConfig& evidence, DiscriminatorConfig& g);

}  // namespace oted
