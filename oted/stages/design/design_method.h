#pragma once
/// The methods of the design, one row each: configuration, help, documentation, `auto` and LearnDesign read this table.

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "oted/sim/simulator.h"
#include "oted/stages/design/design_config.h"
#include "oted/stages/design/design_problem.h"

namespace oted {

/// What a method cannot do without, beside a simulator and its logs.
struct MethodNeeds {
  bool settable_state = false;  ///< the simulator can be set to a logged state
  bool replays = false;         ///< it can be set to states of which the logs show a part
  bool clone = false;           ///< by default the clone acts
  bool gaussian_q = false;      ///< it finds no categorical q
  bool uniform_prior = false;   ///< it takes no other prior
};

struct MethodDescription {
  DesignMethod method;
  std::string name;  ///< as in design.method
  std::string summary;
  MethodNeeds needs = {};
  /// The sections of [design] that it reads: [design.trajectories] and the like.
  std::vector<std::string> sections = {};
  bool is_algorithm1 = false;
  /// Seeds that a setting gets by default. One where the method computes how far its answer can be off: another seed
  /// would give that answer again.
  int n_seeds = 3;
  bool tried_by_auto = false;  ///< where the first method predicts no better than nominal (method_choice.h)
  /// Whether it is what auto begins with. Exactly one method of the table is, for every simulator.
  /// @param of_noise  some parameter is the noise of a sensor, which a replay does not show
  bool (*first_of_auto)(const SimulatorSpec& spec, bool of_noise) = nullptr;
  /// How often q is improved; null where the method tells that as it goes.
  int (*n_iterations)(const DesignConfig& config) = nullptr;
  /// Where its defaults differ from the members' values; null where they do not.
  void (*set_defaults)(DesignConfig& config) = nullptr;
  DesignResult (*learn)(const DesignProblem& problem, const DesignConfig& config) = nullptr;

  /// Whether it learns to tell logs from a simulator.
  bool learns_discriminator() const { return std::ranges::find(sections, "discriminator") != sections.end(); }
};

/// In the order in which they are documented.
const std::vector<MethodDescription>& DesignMethods();
const MethodDescription& Describe(DesignMethod method);
/// @throws UsageError for another name
DesignMethod MethodNamed(const std::string& name);

/// What a user may name: the methods, and auto.
const NamedValues<std::optional<DesignMethod>>& MethodNames();

/// What auto begins with.
DesignMethod FirstMethodOfAuto(const ParameterSpace& space, const SimulatorSpec& spec);

/// "states that can be set, the clone", or "nothing else": what a method needs, in words.
std::string NeedsInWords(const MethodDescription& described);

/// "1 of the methods trajectories and least-squares, 3 of the others": seeded designs of a setting that names no
/// number.
std::string DefaultSeedsInWords();

}  // namespace oted
