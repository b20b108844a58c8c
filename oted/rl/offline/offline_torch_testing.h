#pragma once
/// What tests of offline learners against libtorch share. Include from *_torch_test.cc files only.

#include <vector>

#include "oted/nn/autograd.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/offline/offline_rows.h"

namespace oted {

inline TanhGaussianPolicy PlainActor(int obs_dim, int act_dim, const std::vector<int>& hidden, Rng& rng) {
  const auto n = static_cast<size_t>(obs_dim), m = static_cast<size_t>(act_dim);
  TanhGaussianPolicy actor({std::vector<double>(n, 0.0), std::vector<double>(n, 1.0)}, hidden,
                           std::vector<double>(m, -1.0), std::vector<double>(m, 1.0));
  actor.net().Initialize(rng);
  return actor;
}

/// 64 transitions, a fifth of them terminal.
inline OfflineBatch RandomOfflineBatch(int obs_dim, int act_dim, Rng& rng) {
  constexpr int kBatch = 64;
  OfflineBatch batch;
  batch.size = kBatch;
  const auto n = static_cast<size_t>(kBatch), s = static_cast<size_t>(obs_dim), a = static_cast<size_t>(act_dim);
  batch.observations.resize(2 * n * s);
  rng.FillNormal({batch.observations.data(), batch.observations.size()});
  batch.joint.resize(n * (s + a));
  batch.next_actions.resize(n * a);
  for (float& v : batch.next_actions) v = static_cast<float>(rng.Uniform(-1, 1));
  batch.noise.resize(2 * n * a);
  rng.FillNormal({batch.noise.data(), batch.noise.size()});
  for (size_t b = 0; b < n; ++b) {
    std::copy_n(batch.observations.data() + b * s, s, batch.joint.data() + b * (s + a));
    for (size_t j = 0; j < a; ++j) batch.joint[b * (s + a) + s + j] = static_cast<float>(rng.Uniform(-1, 1));
    batch.rewards.push_back(static_cast<float>(rng.Normal()));
    batch.terminated.push_back(rng.Uniform() < 0.2 ? 1.0f : 0.0f);
  }
  return batch;
}

/// A batch in double precision.
struct BatchTensors {
  torch::Tensor states, next, joint, actions, next_actions, rewards, terminated, noise, next_noise;

  BatchTensors(const OfflineBatch& batch, int64_t obs_dim, int64_t act_dim) {
    const int64_t n = batch.size;
    const torch::Tensor both = ToTensor(batch.observations, 2 * n, obs_dim),
                        drawn = ToTensor(batch.noise, 2 * n, act_dim);
    states = both.slice(0, 0, n);
    next = both.slice(0, n, 2 * n);
    joint = ToTensor(batch.joint, n, obs_dim + act_dim);
    actions = joint.slice(1, obs_dim, obs_dim + act_dim);
    next_actions = ToTensor(batch.next_actions, n, act_dim);
    rewards = ToTensor(batch.rewards, n, 1);
    terminated = ToTensor(batch.terminated, n, 1);
    noise = drawn.slice(0, 0, n);
    next_noise = drawn.slice(0, n, 2 * n);
  }
};

}  // namespace oted
