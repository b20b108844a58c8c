#pragma once
/// Finished designs: samples of q, exports; and what a task and its model have to offer.

#include "python/binding.h"

namespace oted::python {

void AddDesigns(nb::module_& m);

}  // namespace oted::python
