#include "oted/rl/replay_buffer.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/nn/kernels.h"
#include "oted/nn/kernels_math.h"

namespace oted {

ReplayBuffer::ReplayBuffer(int obs_dim, int act_dim, int64_t capacity)
    : obs_dim_(static_cast<size_t>(obs_dim)),
      act_dim_(static_cast<size_t>(act_dim)),
      row_(2 * obs_dim_ + act_dim_ + 2),
      capacity_(capacity) {
  OTED_CHECK(capacity > 0);
}

void ReplayBuffer::Add(std::span<const double> observation, std::span<const double> action, double reward,
                       std::span<const double> next_observation, double discount) {
  const size_t begin = static_cast<size_t>(next_) * row_;
  if (rows_.size() < begin + row_) rows_.resize(begin + row_);
  float* out = rows_.data() + begin;
  const auto put = [&](std::span<const double> values) {
    out = std::transform(values.begin(), values.end(), out, [](double v) { return static_cast<float>(v); });
  };
  put(observation);
  put(action);
  put(next_observation);
  *out++ = static_cast<float>(reward);
  *out = static_cast<float>(discount);
  next_ = (next_ + 1) % capacity_;
  size_ = std::min(size_ + 1, capacity_);
}

void ReplayBuffer::Sample(int batch_size, Rng& rng, TransitionBatch& batch) const {
  OTED_CHECK(size_ > 0);
  const size_t n = static_cast<size_t>(batch_size);
  batch.size = batch_size;
  batch.observations.resize(2 * n * obs_dim_);
  batch.joint.resize(n * (obs_dim_ + act_dim_));
  batch.rewards.resize(n);
  batch.discounts.resize(n);
  batch.noise.resize(2 * n * act_dim_);
  for (size_t i = 0; i < n; ++i) {
    const float* row = rows_.data() + rng.Below(static_cast<uint64_t>(size_)) * row_;
    const float* next_observation = row + obs_dim_ + act_dim_;
    std::copy_n(row, obs_dim_, batch.observations.data() + i * obs_dim_);
    std::copy_n(next_observation, obs_dim_, batch.observations.data() + (n + i) * obs_dim_);
    std::copy_n(row, obs_dim_ + act_dim_, batch.joint.data() + i * (obs_dim_ + act_dim_));
    batch.rewards[i] = next_observation[obs_dim_];
    batch.discounts[i] = next_observation[obs_dim_ + 1];
  }
  // Both uniforms of a pair of normals from one draw, 24 bits each: all that single precision holds.
  const size_t half = (batch.noise.size() + 1) / 2;
  batch.noise.resize(2 * half);
  batch.uniforms.resize(2 * half);
  for (size_t i = 0; i < half; ++i) {
    const uint64_t bits = rng.Next();
    batch.uniforms[i] = static_cast<float>((bits >> 40) + 1) * 0x1p-24f;
    batch.uniforms[half + i] = static_cast<float>((bits >> 16) & 0xFFFFFF) * 0x1p-24f;
  }
  kernels::NormalsFromUniforms(batch.uniforms.data(), batch.noise.data(), half);
}

void ReplayBuffer::Restore(std::span<const float> rows, int64_t next) {
  OTED_CHECK(rows.size() % row_ == 0 && static_cast<int64_t>(rows.size() / row_) <= capacity_ && next < capacity_);
  rows_.assign(rows.begin(), rows.end());
  size_ = static_cast<int64_t>(rows.size() / row_);
  next_ = next;
}

}  // namespace oted
