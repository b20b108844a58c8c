#pragma once
/// Settings of stage 2, the design: a method, and the sections of [design].

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/adversarial/adversarial_config.h"
#include "oted/stages/design/images/images_config.h"
#include "oted/stages/design/rivals/dropo.h"
#include "oted/stages/design/rivals/least_squares.h"
#include "oted/stages/design/trajectories/trajectories_config.h"

namespace oted {

/// How q(z) is found. The table of design_method.h says what each does and needs.
enum class DesignMethod { kTrajectories, kTransitions, kPaper, kLeastSquares, kDropo, kImages };

/// q: a Gaussian in logits of the range, or probabilities of grid values.
enum class DesignerKind { kGaussian, kCategorical };

/// One method with all of its settings; DesignChoice (design_choice.h) has what a user asks for.
struct DesignConfig {
  DesignMethod method = DesignMethod::kTrajectories;
  std::string prior = "uniform";
  DesignerKind designer = DesignerKind::kGaussian;
  double grid_step = 0.05;
  bool grow = false;

  TrajectoriesConfig trajectories;
  AdversarialConfig adversarial;      ///< of Algorithm 1; what it compares, also of images
  DiscriminatorConfig discriminator;  ///< likewise
  LeastSquaresConfig least_squares;
  DropoConfig dropo;
  ImagesConfig images;

  /// The defaults of a method.
  static DesignConfig For(DesignMethod method);

  /// [design] but for the method, then [design.trajectories] and the like.
  std::vector<FieldList> Sections();
  /// Every setting: those of a section in an object of its name, the method's by its name.
  nlohmann::json ToJson() const;
  /// @throws UsageError when settings contradict each other.
  void Check() const;
  /// Whether the clone acts in the design: otherwise nothing waits for it.
  bool UsesClone() const;
  /// How often q is improved; 1 where the method tells that as it goes. Shown as progress.
  int n_iterations() const;

  /// What `prior` stands for. @throws UsageError, DataError (oted/stages/design/prior_source.h)
  Prior MakePrior(const ParameterSpace& space) const;
  /// q before the first iteration, at its prior. @throws UsageError where a categorical one has no two values of a
  /// parameter
  Designer Start(const ParameterSpace& space) const;
};

}  // namespace oted
