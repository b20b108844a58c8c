// package_folders.h in the module: the folders that Python finds when the package is imported.
#include "oted/base/package_folders.h"

#include <nanobind/stl/string.h>

#include "python/package_folders.h"

namespace oted {
namespace {

PackageFolders& Folders() {
  static PackageFolders folders;
  return folders;
}

}  // namespace

const PackageFolders& FoundPackages() { return Folders(); }

namespace python {

void AddFiles(nb::module_& m) {
  m.def(
      "set_package_folders",
      [](const std::string& assets, const std::string& packages, const std::string& plotly_js) {
        Folders() = {assets, packages, plotly_js};
      },
      nb::arg("gymnasium_assets"), nb::arg("packages"), nb::arg("plotly_js"));
}

}  // namespace python
}  // namespace oted
