#pragma once
/// Datasets in D4RL's HDF5 layout (Fu et al. 2020): flat arrays, one row per transition.

#include <string>

#include "oted/data/dataset.h"

namespace oted {

/// Reads an HDF5 file in a child process within limits (hdf5.h): D4RL's layout, or Minari's where the file has
/// one group per episode and `options.format` is not kD4rl. Of D4RL's arrays it reads observations, actions, rewards,
/// terminals, timeouts, next_observations, infos/qpos, infos/qvel; of these rewards, timeouts, next_observations and
/// infos are optional. Float or double, (N) or (N, 1), bool, integer or float flags. Without timeouts an episode is cut
/// after options.max_episode_steps rows; without next_observations, s' is the next row and the last row of each
/// episode, whose successor the file does not hold, is dropped (see d4rl_layout.h). Sizes, types and filters are
/// checked against the file before anything is allocated. Safe from several threads; prints nothing.
/// @throws DataError naming file, field and remedy.
Dataset ReadHdf5(const std::string& path, const DataOptions& options);
/// The same with format "d4rl".
Dataset ReadD4rlHdf5(const std::string& path);

/// Writes D4RL v2's layout, gzip; atomically; equal datasets give equal bytes. Each array is float32, as in D4RL, when
/// that holds all its values exactly, otherwise float64: reading gives back what was written, to the last bit.
/// Flags are h5py's bool. @throws DataError
void WriteD4rlHdf5(const Dataset& dataset, const std::string& path);

}  // namespace oted
