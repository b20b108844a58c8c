#pragma once
/// Joint training of behaviour policy and design (paper, Sec. 1): the clone goes on learning while q does.

#include <deque>
#include <string>
#include <vector>

#include "oted/data/npz.h"
#include "oted/matching/experience.h"
#include "oted/rl/value_dice_update.h"
#include "oted/stages/design/adversarial/adversarial_config.h"

namespace oted {

/// A clone that learns by ValueDICE with the simulators in the place of its environment: the authors' replay, which the
/// policy fills, holds the steps of M(z), z ~ q. The same steps are mixed into both distributions that are compared, so
/// that the logs' behaviour stays the optimum whatever z they come from; they show the critic where the clone goes.
class JointClone {
 public:
  /// @param clone  to begin with; its spread and its normaliser are kept
  JointClone(const TanhGaussianPolicy& clone, const Dataset& logs, const AdversarialConfig& config, RngKey key);

  /// The clone as it is now: the object stays the same, what it does changes with Update.
  const TanhGaussianPolicy& policy() const { return policy_; }
  /// The steps of one iteration, all lanes.
  void Add(const std::vector<LaneExperience>& experience);
  /// config.clone_updates updates; without samples, none. @param moves  false for the critic alone
  /// @return mean of the objective [nats]
  double Update(Rng& rng, bool moves);

  void Save(NpzArrays& arrays);
  void Restore(const NpzArrays& arrays, const std::string& where);

 private:
  const AdversarialConfig& config_;
  ImitationRows logs_;
  std::deque<ImitationRows> replay_;
  ValueDiceUpdate update_;
  ValueDiceBatch batch_;
  TanhGaussianPolicy policy_;
};

}  // namespace oted
