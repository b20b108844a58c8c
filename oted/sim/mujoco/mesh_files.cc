#include "oted/sim/mujoco/mesh_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "oted/base/error.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

// The folders of a variable such as PATH.
std::vector<fs::path> FoldersOf(const char* variable) {
  std::vector<fs::path> folders;
  const char* value = std::getenv(variable);
  std::istringstream list(value == nullptr ? "" : value);
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.emplace_back(folder);
  }
  return folders;
}

// Where `package` may be, the nearest first.
std::vector<fs::path> PackageFolders(const std::string& package, const fs::path& model) {
  std::vector<fs::path> folders;
  for (fs::path above = fs::absolute(model).lexically_normal().parent_path();; above = above.parent_path()) {
    if (above.filename() == package) folders.push_back(above);
    folders.push_back(above / package);
    if (above == above.root_path()) break;
  }
  for (const fs::path& folder : FoldersOf("ROS_PACKAGE_PATH")) {
    if (folder.filename() == package) folders.push_back(folder);
    folders.push_back(folder / package);
  }
  for (const fs::path& folder : FoldersOf("AMENT_PREFIX_PATH")) folders.push_back(folder / "share" / package);
  return folders;
}

fs::path FileInPackage(const std::string& package, const std::string& rest, const fs::path& model) {
  const std::vector<fs::path> folders = PackageFolders(package, model);
  for (const fs::path& folder : folders) {
    if (std::error_code error; fs::is_regular_file(folder / rest, error)) return folder / rest;
  }
  std::vector<std::string> tried;
  for (const fs::path& folder : folders) tried.push_back(folder.string());
  throw DataError(fmt::format(
      "model '{}': its mesh 'package://{}/{}' is in none of {}; put the package's folder '{}' there, or name "
      "the folder that holds it in ROS_PACKAGE_PATH",
      model.string(), package, rest, fmt::join(tried, ", "), package));
}

}  // namespace

void FindMeshFiles(mjSpec& spec, const fs::path& model) {
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_MESH); e != nullptr; e = mjs_nextElement(&spec, e)) {
    mjString* file = mjs_asMesh(e)->file;
    std::string_view name = mjs_getString(file);
    if (name.starts_with("file://")) {
      mjs_setString(file, std::string(name.substr(7)).c_str());
    } else if (name.starts_with("package://")) {
      name.remove_prefix(10);
      const size_t slash = std::min(name.find('/'), name.size());
      const std::string package(name.substr(0, slash));
      const std::string rest(name.substr(std::min(slash + 1, name.size())));
      mjs_setString(file, FileInPackage(package, rest, model).c_str());
    }
  }
}

}  // namespace oted
