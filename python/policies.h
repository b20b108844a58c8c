#pragma once
/// Policies: those of files, to act and to be judged, and Python functions, to be judged.

#include "python/binding.h"

namespace oted::python {

void AddPolicies(nb::module_& m);

}  // namespace oted::python
