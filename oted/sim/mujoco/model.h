#pragma once
/// MuJoCo models, owned. The only folder that includes mujoco.h is this one.

#include <mujoco/mujoco.h>

#include <filesystem>
#include <memory>
#include <string>

namespace oted {

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData, DataDeleter>;

/// A model as its file describes it, and the fingerprint of what was compiled from it.
struct LoadedModel {
  ModelPtr model;      ///< with mjDSBL_AUTORESET set: a diverged state stays as it is and is reported
  std::string sha256;  ///< of the compiled model as mj_saveModel writes it, before that flag was set
};

/// Compiles an MJCF file. MuJoCo's warnings are dropped: nothing is printed and no MUJOCO_LOG.TXT is written, unless
/// the caller has installed a warning handler of its own, which is then kept.
/// @param legacy_capsules  weigh capsules as MuJoCo did before 2.1.1 (legacy_inertia.h)
/// @throws DataError naming the file and MuJoCo's reason.
LoadedModel LoadModel(const std::filesystem::path& path, bool legacy_capsules = false);

}  // namespace oted
