#pragma once
/// Several starts of one agent: some never find out how to move, and early returns tell which.

#include <functional>
#include <memory>

#include "oted/rl/training.h"

namespace oted {

/// In the job's folder, until one is chosen: starts/1/checkpoint.npz, ...
inline constexpr const char* kStartsFolder = "starts";

/// How many begin, and for how long.
struct Starts {
  int n = 1;
  int64_t n_steps = 0;  ///< control steps of each
};

/// A learner from its random stream; what it is given outlives it.
using MakeLearner = std::function<std::unique_ptr<Learner>(EpisodeSource& source, RngKey key, int n_threads)>;

/// Trains `starts.n` learners for `starts.n_steps` control steps each, beside each other where there are threads, looks
/// at each once, in the same episodes, and leaves the checkpoint of the one with the highest mean return as the job's
/// own: TrainInSegments goes on from there. The others are forgotten. Does nothing with one start, where the schedule
/// ends before they do, or where the job has a checkpoint. A stopped run that goes on gives the same bytes.
/// @return control steps of the starts that are not chosen: AgentJob::steps_beside
/// @throws as TrainInSegments
int64_t ChooseStart(const AgentJob& job, const TrainingSchedule& schedule, const Starts& starts,
                    const MakeLearner& make);

}  // namespace oted
