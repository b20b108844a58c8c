#include "oted/sim/mujoco/model_task.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <regex>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
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

namespace {

/// The files that tags of MJCF read as parts of the model: <include file="..."/> and <model file="..."/>. Paths are
/// relative to the model's own folder.
std::vector<std::string> NamedIn(const std::string& text, const std::filesystem::path& folder) {
  static const std::regex tag(R"re(<(?:include|model)\s[^>]*?file\s*=\s*["']([^"']+)["'])re");
  std::vector<std::string> named;
  for (std::sregex_iterator found(text.begin(), text.end(), tag), end; found != end; ++found) {
    const std::filesystem::path path = folder / (*found)[1].str();
    if (std::filesystem::is_regular_file(path)) named.push_back(path.string());
  }
  return named;
}

}  // namespace

std::vector<std::string> ModelFiles(const ModelTask& task) {
  const std::filesystem::path file = FindModelFile(task.model);
  const LoadedModel loaded = LoadModelWithMotors(file, task.motors, task.action_range);
  std::vector<std::string> files = {file.string()};
  const auto add = [&](const std::string& path) {
    if (std::ranges::find(files, path) == files.end()) files.push_back(path);
  };
  // Of MJCF, as mju_getXMLDependencies would; that one fills a vector of the library's own C++.
  for (size_t i = 0; i < files.size(); ++i) {
    for (const std::string& path : NamedIn(ReadFile(files[i]), file.parent_path())) add(path);
  }
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
