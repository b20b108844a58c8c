#include "oted/sim/mujoco/model_task.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/package_folders.h"
#include "oted/sim/mujoco/model.h"

namespace oted {

std::filesystem::path FindModelFile(const std::string& model) {
  constexpr std::string_view kPackage = "package:";
  if (!model.starts_with(kPackage)) {
    if (std::filesystem::is_regular_file(model)) return model;
    throw DataError(
        fmt::format("task.model: no file at '{}'; a relative path starts from the folder of the task file", model));
  }
  const std::string inside = model.substr(kPackage.size());
  std::vector<std::string> folders;
  if (const char* named = std::getenv("OTED_PACKAGES")) {
    std::istringstream list(named);
    for (std::string folder; std::getline(list, folder, ':');) {
      if (!folder.empty()) folders.push_back(folder);
    }
  }
  folders.push_back(FoundPackages().packages);
  for (const std::string& folder : folders) {
    const std::filesystem::path path = std::filesystem::path(folder) / inside;
    if (std::filesystem::is_regular_file(path)) return path;
  }
  throw DataError(
      fmt::format("task.model: no '{}' in {}; install the package, or name the folder that holds it in "
                  "OTED_PACKAGES",
                  inside, fmt::join(folders, ", ")));
}

std::vector<std::string> ModelFiles(const ModelTask& task) {
  const std::filesystem::path file = FindModelFile(task.model);
  const LoadedModel loaded = LoadModelWithMotors(file, task.motors, task.action_range);
  std::vector<std::string> files = {file.string()};
  const auto add = [&](const std::string& path) {
    if (std::ranges::find(files, path) == files.end()) files.push_back(path);
  };
  mjStringVec included;
  mju_getXMLDependencies(file.c_str(), &included);
  for (const std::string& path : included) add(path);
  const mjModel& model = *loaded.model;
  const auto add_all = [&](const int* addresses, mjtSize n) {
    for (mjtSize i = 0; i < n; ++i) {
      if (addresses[i] >= 0) add(model.paths + addresses[i]);
    }
  };
  add_all(model.mesh_pathadr, model.nmesh);
  add_all(model.hfield_pathadr, model.nhfield);
  add_all(model.skin_pathadr, model.nskin);
  add_all(model.tex_pathadr, model.ntex);
  return files;
}

std::string CompileToMjb(const ModelTask& task) {
  LoadedModel loaded = LoadModelWithMotors(FindModelFile(task.model), task.motors, task.action_range);
  loaded.model->opt.disableflags = loaded.disable_flags;
  return SerializeModel(*loaded.model);
}

}  // namespace oted
