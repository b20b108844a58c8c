#pragma once
/// Settings of the design by a discriminator that is told z: [design.images].

#include "oted/base/fields.h"

namespace oted {

/// What g is trained on is [design.adversarial]'s evidence, how, [design.discriminator]'s.
struct ImagesConfig {
  int n_iterations = 80;
  int n_sims = 128;
  int replay_iterations = 10;
  int n_calibrations = 2;

  FieldList Fields();
};

}  // namespace oted
