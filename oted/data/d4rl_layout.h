#pragma once
/// D4RL's arrays (Fu et al. 2020) made a Dataset, whatever file they lie in: one row per transition, flat.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// Named numeric arrays in a file.
class ArraySource {
 public:
  virtual ~ArraySource() = default;
  virtual bool Has(const std::string& name) const = 0;
  /// The array's shape, once it is known to be numeric and to fit in the file. @throws DataError
  virtual std::vector<int64_t> Shape(const std::string& name) const = 0;
  /// Fills `out`, as long as the array, in C order. @throws DataError
  virtual void Read(const std::string& name, std::span<double> out) const = 0;
};

/// Where the task's time limit is not known, an episode without timeouts in its file is cut after this many rows:
/// D4RL's v0 files leave the flag out, and its locomotion tasks have this time limit.
inline constexpr int kD4rlTimeLimit = 1000;

/// Reads observations, actions, terminals and, where they are there, rewards, timeouts, next_observations, infos/qpos
/// and infos/qvel. Matrices are (N, d), (N) meaning d = 1; vectors (N) or (N, 1); flags 0 or 1 in any numeric type.
/// What a v0 file leaves out is inferred: timeouts as above; s' as the next row of the same episode. An episode's last
/// row has no such successor: it is dropped and the row before marked as a timeout, since its s' is not terminal.
/// What was inferred is in the dataset's remarks. `max_episode_steps` is the time limit; 0: kD4rlTimeLimit.
/// @throws DataError naming `file`, the array and the remedy.
Dataset ReadD4rlArrays(const ArraySource& source, const std::string& file, int max_episode_steps = 0);

}  // namespace oted
