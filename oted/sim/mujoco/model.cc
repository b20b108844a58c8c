#include "oted/sim/mujoco/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <span>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/sim/mujoco/legacy_inertia.h"

namespace oted {
namespace {

// Without a handler MuJoCo prints every warning and appends it to MUJOCO_LOG.TXT in the working directory.
void SilenceWarnings() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_warning == nullptr) mju_user_warning = [](const char*) {};
  });
}

struct SpecDeleter {
  void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
};

/// Null with a `reason` where the file does not compile.
ModelPtr CompileWithLegacyCapsules(const std::filesystem::path& path, std::span<char> reason) {
  const std::unique_ptr<mjSpec, SpecDeleter> spec(
      mj_parseXML(path.c_str(), nullptr, reason.data(), static_cast<int>(reason.size())));
  if (spec == nullptr) return nullptr;
  ModelPtr model(mj_compile(spec.get(), nullptr));
  if (model != nullptr) {
    UseLegacyCapsules(*spec, *model, path.string());
    model.reset(mj_compile(spec.get(), nullptr));
  }
  if (model == nullptr) std::strncpy(reason.data(), mjs_getError(spec.get()), reason.size() - 1);
  return model;
}

}  // namespace

LoadedModel LoadModel(const std::filesystem::path& path, bool legacy_capsules) {
  SilenceWarnings();
  if (!std::filesystem::is_regular_file(path)) {
    throw DataError(fmt::format("no model file at '{}'; set OTED_ASSETS to the folder that holds it", path.string()));
  }
  std::array<char, 1000> reason{};
  LoadedModel loaded;
  loaded.model = legacy_capsules
                     ? CompileWithLegacyCapsules(path, reason)
                     : ModelPtr(mj_loadXML(path.c_str(), nullptr, reason.data(), static_cast<int>(reason.size())));
  if (loaded.model == nullptr) {
    std::string text = reason.data();
    std::replace(text.begin(), text.end(), '\n', ' ');
    throw DataError(fmt::format("MuJoCo {} cannot load '{}': {}", mj_versionString(), path.string(), text));
  }
  std::string bytes(static_cast<size_t>(mj_sizeModel(loaded.model.get())), '\0');
  mj_saveModel(loaded.model.get(), nullptr, bytes.data(), static_cast<mjtSize>(bytes.size()));
  loaded.sha256 = Sha256(bytes);
  loaded.model->opt.disableflags |= mjDSBL_AUTORESET;
  return loaded;
}

}  // namespace oted
