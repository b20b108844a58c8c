#pragma once
/// Logged trajectories: from files by the library's readers, from arrays, and the checks of them.

#include "python/binding.h"

namespace oted::python {

void AddLogs(nb::module_& m);

}  // namespace oted::python
