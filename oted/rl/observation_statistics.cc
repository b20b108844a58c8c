#include "oted/rl/observation_statistics.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/rl/training.h"

namespace oted {

ObservationStatistics::ObservationStatistics(int obs_dim)
    : mean_(static_cast<size_t>(obs_dim), 0.0), squares_(mean_), magnitude_(mean_) {
  UpdateNormalizer();
}

void ObservationStatistics::Add(std::span<const double> observations) {
  OTED_CHECK(observations.size() % mean_.size() == 0);
  for (; !observations.empty(); observations = observations.subspan(mean_.size())) {
    ++count_;
    // Welford's recurrence: exact where a difference of two large sums would not be.
    for (size_t j = 0; j < mean_.size(); ++j) {
      const double before = observations[j] - mean_[j];
      mean_[j] += before / count_;
      squares_[j] += before * (observations[j] - mean_[j]);
      magnitude_[j] = std::max(magnitude_[j], std::abs(observations[j]));
    }
  }
  UpdateNormalizer();
}

void ObservationStatistics::UpdateNormalizer() {
  std::vector<double> deviation(squares_);
  for (double& value : deviation) value = count_ > 0 ? std::sqrt(value / count_) : 0.0;
  normalizer_ = Normalizer::FromMoments(mean_, std::move(deviation), magnitude_);
  for (auto* values : {&normalizer_.mean, &normalizer_.scale}) {
    for (double& value : *values) value = static_cast<double>(static_cast<float>(value));
  }
}

std::vector<double> ObservationStatistics::Normalized(std::span<const double> observations) const {
  const size_t obs_dim = mean_.size();
  std::vector<double> normalized(observations.begin(), observations.end());
  for (size_t i = 0; i < normalized.size(); ++i) {
    normalized[i] = (normalized[i] - normalizer_.mean[i % obs_dim]) / normalizer_.scale[i % obs_dim];
  }
  return normalized;
}

void ObservationStatistics::Normalize(TransitionBatch& batch) const {
  const size_t obs_dim = mean_.size(), n = static_cast<size_t>(batch.size), joint_dim = batch.joint.size() / n;
  std::vector<float> mean(normalizer_.mean.begin(), normalizer_.mean.end()),
      scale(normalizer_.scale.begin(), normalizer_.scale.end());
  for (size_t row = 0; row < 2 * n; ++row) {
    float* s = batch.observations.data() + row * obs_dim;
    for (size_t j = 0; j < obs_dim; ++j) s[j] = (s[j] - mean[j]) / scale[j];
    if (row < n) std::copy_n(s, obs_dim, batch.joint.data() + row * joint_dim);
  }
}

void ObservationStatistics::Save(NpzArrays& arrays) const {
  arrays["observations/count"] = NpyArray(std::vector<double>{count_});
  arrays["observations/mean"] = NpyArray(mean_);
  arrays["observations/squares"] = NpyArray(squares_);
  arrays["observations/magnitude"] = NpyArray(magnitude_);
}

void ObservationStatistics::Restore(const NpzArrays& arrays) {
  count_ = CheckpointValues<double>(arrays, "observations/count", 1)[0];
  mean_ = CheckpointValues<double>(arrays, "observations/mean", mean_.size());
  squares_ = CheckpointValues<double>(arrays, "observations/squares", squares_.size());
  magnitude_ = CheckpointValues<double>(arrays, "observations/magnitude", magnitude_.size());
  UpdateNormalizer();
}

}  // namespace oted
