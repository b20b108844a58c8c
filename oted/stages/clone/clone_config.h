#pragma once
/// Settings of stage 1, the clone.

#include <vector>

#include "oted/base/fields.h"
#include "oted/rl/value_dice_update.h"
#include "oted/sim/simulator.h"

namespace oted {

enum class CloneMethod {
  kBehavioralCloning,  ///< "bc"
  kValueDice,          ///< "valuedice"
  kAuto,               ///< "auto": whichever of the two imitates held-out episodes better
};
const NamedValues<CloneMethod>& CloneMethodNames();

/// The policy that ValueDICE begins with.
enum class ValueDiceStart { kBehavioralClone, kRandomWeights };

struct CloneConfig {
  CloneMethod method = CloneMethod::kBehavioralCloning;
  std::vector<int> hidden = {256, 256};
  std::vector<int> filters = {16, 32};
  double learning_rate = 1e-3;
  double weight_decay = 1e-5;
  int batch_size = 256;
  int max_steps = 6'000;
  double held_out = 0.15;
  int patience = 10;
  int check_interval = 100;

  ValueDiceStart valuedice_start = ValueDiceStart::kBehavioralClone;
  int valuedice_updates = 6'000;
  int valuedice_batch = 256;
  std::vector<int> valuedice_hidden = {256, 256};
  double valuedice_actor_rate = 1e-5;
  double valuedice_critic_rate = 1e-3;
  double valuedice_discount = 0.99;
  double valuedice_penalty = 10;
  double valuedice_orthogonal = 1e-4;

  FieldList Fields();
  ValueDiceOptions ValueDice() const;
  /// `method` as far as the task's actions allow: behavioural cloning is all that discrete ones do.
  /// @throws UsageError for ValueDICE of discrete actions or images
  CloneMethod MethodFor(const SimulatorSpec& spec) const;
};

}  // namespace oted
