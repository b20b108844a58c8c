#include "oted/data/d4rl_hdf5.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/d4rl_layout.h"
#include "oted/data/hdf5.h"
#include "oted/data/minari_layout.h"

namespace oted {

Dataset ReadHdf5(const std::string& path, const DataOptions& options) {
  return ReadHdf5File(path, options.hdf5_limits, [&](const Hdf5Reader& source) {
    const bool is_minari = !source.Has("observations") && source.Has("episode_0");
    if (is_minari && options.format == DataFormat::kD4rl) {
      throw DataError(fmt::format(
          "'{}' is in Minari's layout (one group per episode), wanted D4RL's flat arrays; set the format to "
          "minari, or leave it out",
          path));
    }
    if (is_minari || options.format == DataFormat::kMinari) return ReadMinariEpisodes(source, path);
    return ReadD4rlArrays(source, path, options.max_episode_steps);
  });
}

Dataset ReadD4rlHdf5(const std::string& path) {
  DataOptions options;
  options.format = DataFormat::kD4rl;
  return ReadHdf5(path, options);
}

void WriteD4rlHdf5(const Dataset& dataset, const std::string& path) {
  dataset.Check();
  AtomicFile file(path);
  WriteHdf5File(file.temporary_path().string(), path, [&](Hdf5Output& writer) {
    const Array2<double>& obs = dataset.observations;
    const Array2<double>& next_obs = dataset.next_observations;
    const bool obs_fit = FitsFloat32({obs.values(), next_obs.values()});
    writer.Numbers("observations", obs, obs_fit);
    writer.Numbers("next_observations", next_obs, obs_fit);
    writer.Numbers("actions", dataset.actions, FitsFloat32({dataset.actions.values()}));
    if (!dataset.rewards.empty()) writer.Numbers("rewards", dataset.rewards, FitsFloat32({dataset.rewards}));
    writer.Flags("terminals", dataset.terminals);
    writer.Flags("timeouts", dataset.timeouts);
    if (dataset.has_states()) {
      const bool states_fit = FitsFloat32({dataset.qpos.values(), dataset.qvel.values()});
      writer.Group("infos");
      writer.Numbers("infos/qpos", dataset.qpos, states_fit);
      writer.Numbers("infos/qvel", dataset.qvel, states_fit);
    }
  });
  file.Commit();
}

}  // namespace oted
