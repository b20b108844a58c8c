#pragma once
/// Lanes of a simulator, for environments.

#include "python/binding.h"

namespace oted::python {

void AddSimulators(nb::module_& m);

}  // namespace oted::python
