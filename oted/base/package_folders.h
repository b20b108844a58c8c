#pragma once
/// Where files of installed packages lie. Every program links one of two definitions: what was found when it was built
/// (oted/base/built), or in the Python module what Python finds when it starts (python/package_folders.cc).

#include <string>

namespace oted {

struct PackageFolders {
  std::string gymnasium_assets;  ///< the folder with hopper.xml, half_cheetah.xml, ...
  std::string packages;          ///< the folder that models named "package:..." are looked for in
  std::string plotly_js;         ///< the file plotly.min.js
};

/// The environment variables OTED_ASSETS, OTED_PACKAGES and OTED_PLOTLY_JS come before these.
const PackageFolders& FoundPackages();

}  // namespace oted
