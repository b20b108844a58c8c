#pragma once
/// MuJoCo models, owned. The only folder that includes mujoco.h is this one.

#include <mujoco/mujoco.h>

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace oted {

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
struct SpecDeleter {
  void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
};
using ModelPtr = std::unique_ptr<mjModel, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData, DataDeleter>;
using SpecPtr = std::unique_ptr<mjSpec, SpecDeleter>;

/// A model as its file describes it, and the fingerprint of what was compiled from it.
struct LoadedModel {
  ModelPtr model;      ///< with mjDSBL_AUTORESET set: a diverged state stays as it is and is reported
  int disable_flags;   ///< as the file has them, without that flag
  SpecPtr spec;        ///< what it was compiled from; copy it before changing it
  std::string sha256;  ///< ModelSha256, before that flag was set
};

/// Compiles an MJCF file (TakeOverMujocoErrors). Options that no simulation ends with, or that are no numbers, are
/// refused.
/// @param legacy_capsules  weigh capsules as MuJoCo did before 2.1.1 (legacy_inertia.h)
/// @throws DataError naming the file and MuJoCo's reason.
LoadedModel LoadModel(const std::filesystem::path& path, bool legacy_capsules = false);

/// The same with a motor on each hinge or slide joint that one of the paths "joint/NAME" matches, named as the joint:
/// its control is the joint's torque [N m] or force [N]. Its control range is the joint's actuatorfrcrange (URDF: the
/// effort limit), otherwise `range`.
/// @param range {low, high}, or empty  @throws UsageError when a path matches nothing or a joint has no range at all
LoadedModel LoadModelWithMotors(const std::filesystem::path& path, const std::vector<std::string>& motors,
                                const std::vector<double>& range);

/// Whether MuJoCo may take these bodies for simple ones (mjsBody.simple). It computes less for a body whose frame of
/// inertia is its frame, and refuses to move that frame then. @param bodies  ids of a spec that was compiled
void AllowSimple(mjSpec& spec, const std::set<int>& bodies, bool allow);

/// Compiles it again so that the frames of inertia of these simple bodies can move. The fingerprint and `loaded.spec`
/// stay the file's. @param bodies  ids  @throws DataError with MuJoCo's reason
void LetInertiaMove(LoadedModel& loaded, const std::set<int>& bodies);

/// The compiled model as a .mjb file has it.
std::string SerializeModel(const mjModel& model);

}  // namespace oted
