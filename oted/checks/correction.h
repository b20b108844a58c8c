#pragma once
/// A change of logged columns.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

enum class CorrectionKind {
  kSign,
  kSwap,
  kZero,
  kUnit,
  kActionSign,
  kActionSwap,
  kActionUnit,
  kQuaternionOrder,
  kMirror
};

struct Correction {
  CorrectionKind kind;
  std::vector<int> columns = {};  ///< observations or actions; of a swap two, or two pairs one after the other
  double value = 0;               ///< what is added (a zero), or the factor (a unit)
  std::vector<int> judged = {};   ///< the observations whose prediction must get better
  int command = -1;               ///< the action that is turned round with a mirrored joint

  /// The name of its finding: "joint_sign".
  const char* Check() const;
  struct Words {
    std::string change;  ///< "joint/elbow/qpos and joint/elbow/qvel turned round"
    std::string remedy;  ///< "turn round the sign of joint/elbow/qpos and joint/elbow/qvel"
  };
  Words InWords(const SimulatorSpec& spec) const;
  /// The line of a task file that makes this change of all recordings: 'data.scale = { "actuator/elbow" = -1 }'. Empty
  /// where none does.
  std::string Setting(const SimulatorSpec& spec) const;
  std::vector<std::string> Names(const SimulatorSpec& spec) const;
  void ApplyTo(Dataset& dataset) const;
  /// The same change of states, (n, state_dim): a rate that no observation shows goes with its position.
  void ApplyToStates(Array2<double>& states, const SimulatorSpec& spec) const;
  bool IsOfActions() const {
    return kind == CorrectionKind::kActionSign || kind == CorrectionKind::kActionSwap ||
           kind == CorrectionKind::kActionUnit;
  }
};

}  // namespace oted
