#pragma once
/// The folders that Python finds when the package is imported, for oted/base/package_folders.h.

#include "python/binding.h"

namespace oted::python {

void AddFiles(nb::module_& m);

}  // namespace oted::python
