#pragma once
/// Short films of replays: the same moments of several simulators, to be played side by side.

#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/simulator.h"

namespace oted {

/// The motion of one robot: a pose for each of T moments.
struct PoseTrack {
  std::vector<double> z;  ///< parameters of the simulator that it is drawn in
  Array2<double> poses;   ///< (T, numbers of a pose); a row that is not finite shows the pose before it
};

/// The pictures of one track as a strip: `columns` frames in a row, row by row, in one WebP file.
struct FilmStrip {
  std::string webp;
  int columns = 0;
  int n_frames = 0;
};

FilmStrip DrawFilm(Renderer& renderer, const PoseTrack& track);

/// The poses that logged observations show, one row each: (T, numbers of a pose). Where an observation determines no
/// state, its row is NaN. A joint position that no observation shows (the root's x of Gymnasium's tasks) stands still
/// in all rows; it is filled in by adding up the logged velocities, from 0, so that the logged robot travels as the
/// simulated ones do.
/// @param observations  (T, obs_dim), one control period apart
/// @throws UsageError when the simulator's state cannot be set (SimulatorSpec::can_replay)
Array2<double> PosesOfObservations(Simulator& simulator, const Array2<double>& observations);

}  // namespace oted
