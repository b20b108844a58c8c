#pragma once
/// A user's Gymnasium environment as a simulator: oted/gym.py holds the environments and the user's functions, this
/// file makes a Simulator of them. Calls into Python are made one after the other, whatever thread makes them.

#include "python/binding.h"

namespace oted::python {

/// What stands between Ctrl-C and a stage that steps a user's environment: stages look at their stop flag between units
/// of work, which may take long there.
class Sessions {
 public:
  static void Begin();
  static void End();
  static void AskToStop();
  /// @throws Interrupted where the one session that runs was asked to stop a while ago
  static void Check();
};

void AddGymSimulators(nb::module_& m);

}  // namespace oted::python
