#pragma once
/// Settings of Algorithm 1: [design.adversarial].

#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/experience.h"
#include "oted/sim/simulator.h"

namespace oted {

enum class RolloutStarts { kDataset, kInitial };
enum class RolloutActions { kReplayed, kClone };
/// What g sees: (s, a), (s, a, s' - s), or s alone.
enum class SeenByG { kStateAction, kTransition, kState };
enum class LoggedRows { kAll, kFirst };
enum class DesignReward { kPaper, kLogRatio };

/// Algorithm 1: from which evidence, how much of it, and how q(z) moves. The members' values are the defaults of the
/// method `transitions`. SetPaperDefaults has those of `paper`, StartAtResets those where rollouts begin at the
/// simulator's own starts.
struct AdversarialConfig {
  RolloutStarts starts = RolloutStarts::kDataset;
  RolloutActions actions = RolloutActions::kReplayed;
  SeenByG evidence = SeenByG::kTransition;
  int horizon = 10;
  int n_steps = 60;
  LoggedRows rows = LoggedRows::kAll;
  int stack = 1;
  double clone_noise = 1.0;
  int clone_updates = 0;
  double clone_replay = 0.1;
  double clone_rate = 1e-5;
  int n_iterations = 100;
  int n_sims = 32;
  double step_mean = 0.5;
  double step_log_std = 0.25;
  double lambda = 0.01;
  double initial_std = 1.2;
  DesignReward reward = DesignReward::kPaper;
  double reward_floor = 1e-6;
  double average = 0.0;
  int replay_iterations = 10;

  FieldList Fields();
  /// Names of those that say what g is shown: the common judge shows the same, whatever the method.
  static std::vector<std::string> EvidenceNames();
  /// @throws UsageError when settings contradict each other.
  void Check() const;
  /// Those of the method `paper`: the clone acts, g sees (s, a); rollouts begin at logged states
  /// (docs/deviations.md#logged-starts). A small g: a larger one remembers short logs, and takes most of the time.
  void SetPaperDefaults(DiscriminatorConfig& g);
  /// To the letter: the clone rolled out from the simulator's own starts. All there is where no state can be set.
  void StartAtResets();
  /// Complete with what the simulator adds: past actions and the image's shape.
  EvidenceConfig Evidence(const SimulatorSpec& spec) const;
};

}  // namespace oted
