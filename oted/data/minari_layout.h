#pragma once
/// Minari's episodes (one group per episode, T + 1 observations) made a Dataset.

#include <string>

#include "oted/data/dataset.h"
#include "oted/data/hdf5.h"

namespace oted {

/// Reads the groups episode_<i> in the order of i: observations (T + 1, ...), actions (T, ...), terminations (T),
/// truncations (T), optional rewards (T; all NaN: none) and infos/qpos, infos/qvel (T or T + 1). Dict and Tuple spaces
/// are flattened in the order of their names and named. An episode that neither terminates nor is truncated ends in a
/// timeout; one without an action is left out. `promised` is the number of episodes
/// that the metadata name; -1: unknown. In the child process that reads. @throws DataError
Dataset ReadMinariEpisodes(const Hdf5Reader& source, const std::string& file, int64_t promised = -1);

}  // namespace oted
