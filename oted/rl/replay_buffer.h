#pragma once
/// A ring of transitions and the mini-batches drawn from it.

#include <span>

#include "oted/base/array2.h"
#include "oted/base/rng.h"

namespace oted {

/// One mini-batch of B transitions, laid out as SAC's matrix products read it.
struct TransitionBatch {
  int size = 0;                       ///< B
  AlignedVector<float> observations;  ///< (2B, obs_dim): s of all rows, then s' of all rows
  AlignedVector<float> joint;         ///< (B, obs_dim + act_dim): [s, a], a in [-1, 1]
  AlignedVector<float> rewards;       ///< (B)
  AlignedVector<float> discounts;     ///< (B), of the value of s'; 0 where it has none
  AlignedVector<float> noise;         ///< (2B, act_dim) standard normals for the actions at s and at s'
  AlignedVector<float> uniforms;      ///< what `noise` was made of
};

/// Keeps the last `capacity` transitions.
class ReplayBuffer {
 public:
  ReplayBuffer(int obs_dim, int act_dim, int64_t capacity);
  /// @param action    squashed to [-1, 1]
  /// @param discount  what the value of s' counts for: gamma, or 0 where the episode terminated; a time limit does not
  void Add(std::span<const double> observation, std::span<const double> action, double reward,
           std::span<const double> next_observation, double discount);
  /// Rows drawn uniformly with replacement, and the noise for the update.
  void Sample(int batch_size, Rng& rng, TransitionBatch& batch) const;
  int64_t size() const { return size_; }

  /// For checkpoints: the rows in use, (size, row), and the ring's position.
  std::span<const float> rows() const { return {rows_.data(), static_cast<size_t>(size_) * row_}; }
  int64_t next() const { return next_; }
  void Restore(std::span<const float> rows, int64_t next);

 private:
  size_t obs_dim_, act_dim_, row_;  // row: s, a, s', r, discount
  int64_t capacity_;
  int64_t size_ = 0, next_ = 0;
  AlignedVector<float> rows_;
};

}  // namespace oted
