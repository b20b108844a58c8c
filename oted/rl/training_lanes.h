#pragma once
/// The lanes in which a learner's episodes take place.

#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "oted/rl/training.h"

namespace oted {

/// Episodes go on from one segment of the training to the next. A checkpoint holds of each how it came about, its
/// parameters, random stream and actions, from which any simulator makes it again. Where the task's clock ends no
/// episode, a segment begins with fresh ones.
class TrainingLanes {
 public:
  /// What it is given must outlive it.
  TrainingLanes(const SimulatorFactory& factory, EpisodeSource& source, int n_lanes, int n_threads);

  const Simulator& simulator() const { return *simulator_; }
  const std::vector<int>& all() const { return all_; }
  const EpisodeStatistics& episodes() const { return episodes_; }

  /// Before a segment: begins an episode in each lane that has none. Draws from `rng`.
  void BeginSegment(Rng& rng);
  /// One control step of all lanes. @param actions  (n_lanes, act_dim)
  void Step(std::span<const double> actions);
  /// After a step that ended the lane's episode: tells the source of it, and begins the next.
  void Next(int lane, Rng& rng);

  void Save(NpzArrays& arrays) const;
  /// @throws DataError where the arrays are not those of Save for as many lanes
  void Restore(const NpzArrays& arrays);

 private:
  /// Of the episode under way.
  struct Lane {
    std::vector<double> z;
    Rng::State start = {};  ///< of the stream that its start state was drawn from
    std::vector<double> actions;
  };
  void Begin(int lane, Rng& rng);
  /// Steps these lanes and counts that, where they do not diverge.
  void StepLanes(std::span<const int> lanes, std::span<const double> actions);
  bool EpisodesEnd() const;

  EpisodeSource& source_;
  std::unique_ptr<Simulator> simulator_;
  EpisodeStatistics episodes_;
  std::vector<int> all_;
  std::vector<Lane> lanes_;
  bool has_begun_ = false;
};

}  // namespace oted
