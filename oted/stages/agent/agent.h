#pragma once
/// Stage 4 (paper, Algorithm 2): the episodes of an agent that trains in the designed simulators. Lines 2 and 3, run
/// and update, are TrainAgent's own loop (oted/rl). Which simulators: oted/run/training_ground.h; all agents of a run:
/// oted/run/agents_step.h.

#include <vector>

#include "oted/matching/designer.h"
#include "oted/rl/training.h"

namespace oted {

/// Algorithm 2, line 1: at each episode's start i ~ U[1, n], and the simulator is set to the mode z_i of q(.|h_i). With
/// a single z the simulator is a fixed one.
/// @param modes  (n, parameters), at least one
EpisodeParameters DrawModes(std::vector<std::vector<double>> modes);

/// Sec. 4, step 3: z is drawn anew from q at each episode's start, here from the mixture of the n seeds' q(.|h_i).
/// @param q  at least one
EpisodeParameters DrawSamples(std::vector<Designer> q);

}  // namespace oted
