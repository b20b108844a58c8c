#pragma once
/// Observation normalisation for learners that replay transitions, as Stable-Baselines3's VecNormalize does it: running
/// mean and spread of what the policy was shown, applied anew to every batch that is drawn.

#include <span>
#include <vector>

#include "oted/data/normalizer.h"
#include "oted/data/npz.h"
#include "oted/rl/replay_buffer.h"

namespace oted {

class ObservationStatistics {
 public:
  explicit ObservationStatistics(int obs_dim);
  /// Observations (n, obs_dim), raw.
  void Add(std::span<const double> observations);
  /// Of all so far, with Normalizer::Fit's floor of the scale; the identity before the first. Its numbers are rounded
  /// to single precision, so that the flat parameters of a policy hold it exactly.
  const Normalizer& normalizer() const { return normalizer_; }
  /// Observations (n, obs_dim), as the policy's normaliser would bring them to its network.
  std::vector<double> Normalized(std::span<const double> observations) const;
  /// The observations of a batch of raw transitions.
  void Normalize(TransitionBatch& batch) const;

  /// Restore throws DataError naming the array that is missing or of another size.
  void Save(NpzArrays& arrays) const;
  void Restore(const NpzArrays& arrays);

 private:
  void UpdateNormalizer();

  double count_ = 0;
  std::vector<double> mean_, squares_, magnitude_;  ///< squares: the sum of squared deviations from the mean
  Normalizer normalizer_;
};

}  // namespace oted
