// The folders that were found when the program was built.
#include "oted/base/package_folders.h"

namespace oted {

const PackageFolders& FoundPackages() {
  static const PackageFolders folders{OTED_BUILT_ASSETS, OTED_BUILT_PACKAGES, OTED_BUILT_PLOTLY_JS};
  return folders;
}

}  // namespace oted
