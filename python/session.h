#pragma once
/// A stage of a run: the work goes on in a thread of its own, while the calling thread hands its events to Python and
/// watches for Ctrl-C.

#include "python/binding.h"

namespace oted::python {

void AddSession(nb::module_& m);

}  // namespace oted::python
