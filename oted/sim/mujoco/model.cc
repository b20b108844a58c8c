#include "oted/sim/mujoco/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <mutex>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

// Without a handler MuJoCo prints every warning and appends it to MUJOCO_LOG.TXT in the working directory.
void SilenceWarnings() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_warning == nullptr) mju_user_warning = [](const char*) {};
  });
}

}  // namespace

LoadedModel LoadModel(const std::filesystem::path& path) {
  SilenceWarnings();
  if (!std::filesystem::is_regular_file(path)) {
    throw DataError(fmt::format("no model file at '{}'; set OTED_ASSETS to the folder that holds it", path.string()));
  }
  std::array<char, 1000> reason{};
  LoadedModel loaded;
  loaded.spec.reset(mj_parseXML(path.c_str(), nullptr, reason.data(), static_cast<int>(reason.size())));
  if (loaded.spec != nullptr) loaded.model.reset(mj_compile(loaded.spec.get(), nullptr));
  if (loaded.model == nullptr) {
    std::string text = loaded.spec == nullptr ? reason.data() : mjs_getError(loaded.spec.get());
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
