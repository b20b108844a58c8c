#pragma once
/// What the SAC benchmarks time: whole updates on noise, and an update's matrix products alone.

#include <benchmark/benchmark.h>
#include <time.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "benchmarks/blas.h"
#include "oted/nn/gemm.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/autograd/on_device.h"
#include "oted/rl/crossq_update.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/sac_update.h"

namespace oted {

/// [s]
inline double Now(clockid_t clock) {
  timespec time;
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

inline constexpr int kBatch = 256;
inline constexpr int kRows = 10'000;  // of the replay buffer
inline const std::vector<int> kHidden = {256, 256};

// A learner of the given size with a replay buffer of noise.
class ReplayWorkload {
 public:
  enum class Algorithm { kSac, kCrossQ };

  /// @param autograd_on  none for the hand-written update, or the device that OnDevice takes
  ReplayWorkload(Algorithm algorithm, int obs_dim, int act_dim,
                 std::optional<TrainingDevice> autograd_on = std::nullopt, int batch_size = kBatch)
      : batch_size_(batch_size), buffer_(obs_dim, act_dim, kRows) {
    const TanhGaussianPolicy actor = Actor(obs_dim, act_dim, rng_);
    const double entropy = -static_cast<double>(act_dim);
    const auto set_update = [&](auto update, const auto& options) {
      using Update = decltype(update);
      if (!autograd_on) {
        update_ = std::make_unique<Update>(std::move(update));
      } else {
        update_ = OnDevice(std::move(update), options, *autograd_on);
      }
    };
    if (algorithm == Algorithm::kSac) {
      const SacUpdateOptions options{.target_entropy = entropy};
      set_update(SacUpdate(actor, kHidden, options, rng_), options);
    } else {
      const CrossQUpdateOptions options{.target_entropy = entropy};
      set_update(CrossQUpdate(actor, kHidden, options, rng_), options);
    }
    std::vector<double> s(static_cast<size_t>(obs_dim)), a(static_cast<size_t>(act_dim)), s2(s.size());
    for (int row = 0; row < kRows; ++row) {
      for (std::vector<double>* values : {&s, &s2}) {
        for (double& value : *values) value = rng_.Normal();
      }
      for (double& value : a) value = rng_.Uniform(-1, 1);
      buffer_.Add(s, a, rng_.Normal(), s2, row % 100 == 99 ? 0 : 0.99);
    }
  }

  void Step() {
    buffer_.Sample(batch_size_, rng_, batch_);
    losses_ = update_->Step(batch_);
    benchmark::DoNotOptimize(losses_);
  }

  ReplayUpdate& update() { return *update_; }
  /// Of the last step.
  const TransitionBatch& batch() const { return batch_; }
  const ReplayLosses& losses() const { return losses_; }

 private:
  static TanhGaussianPolicy Actor(int obs_dim, int act_dim, Rng& rng) {
    const std::vector<double> zeros(static_cast<size_t>(obs_dim), 0.0), ones(zeros.size(), 1.0);
    const std::vector<double> high(static_cast<size_t>(act_dim), 1.0), low(high.size(), -1.0);
    TanhGaussianPolicy actor(Normalizer{zeros, ones}, kHidden, low, high);
    actor.net().Initialize(rng);
    return actor;
  }

  Rng rng_{1};
  int batch_size_;
  ReplayBuffer buffer_;
  std::unique_ptr<ReplayUpdate> update_;
  TransitionBatch batch_;
  ReplayLosses losses_;
};

// The products of one network on arrays of the sizes that the update has.
class Products {
 public:
  using Multiply = decltype(&OwnGemm);

  Products(Multiply multiply, int in, int out) : multiply_(multiply) {
    for (const int width : {kHidden[0], kHidden[1], out}) {
      layers_.push_back({in, width});
      in = width;
    }
    Rng rng(1);
    for (AlignedVector<float>* values : {&x_, &weight_, &y_}) {
      values->resize(2 * kBatch * 256);
      for (float& value : *values) value = static_cast<float>(0.1 * rng.Normal());
    }
  }

  void Forward(int batch) {
    for (const auto& [in, out] : layers_) {
      multiply_(Op::kNone, Op::kNone, batch, out, in, x_.data(), in, weight_.data(), out, 0.0f, y_.data(), out);
    }
  }

  // `dx`: how many columns of the input's gradient are wanted.
  void Backward(int batch, bool parameter_gradient, int dx) {
    for (size_t l = layers_.size(); l-- > 0;) {
      const auto& [in, out] = layers_[l];
      if (parameter_gradient) {
        multiply_(Op::kTranspose, Op::kNone, in, out, batch, x_.data(), in, weight_.data(), out, 0.0f, y_.data(), out);
      }
      const int columns = l == 0 ? dx : in;
      if (columns == 0) continue;
      multiply_(Op::kNone, Op::kTranspose, batch, columns, out, x_.data(), out, weight_.data(), out, 0.0f, y_.data(),
                columns);
    }
  }

 private:
  struct Size {
    int in, out;
  };
  Multiply multiply_;
  std::vector<Size> layers_;
  AlignedVector<float> x_, weight_, y_;
};

// The products that one update needs, in SacUpdate::Step's order.
inline void MultiplyAll(Products& actor, Products& critic, int act_dim) {
  actor.Forward(2 * kBatch);                           // a, a'
  for (int i = 0; i < 2; ++i) critic.Forward(kBatch);  // Q'_i(s', a')
  for (int i = 0; i < 2; ++i) {                        // the critics' step
    critic.Forward(kBatch);
    critic.Backward(kBatch, true, 0);
  }
  for (int i = 0; i < 2; ++i) critic.Forward(kBatch);  // the actor's step
  for (int i = 0; i < 2; ++i) critic.Backward(kBatch / 2, false, act_dim);
  actor.Backward(kBatch, true, 0);
  benchmark::ClobberMemory();
}

}  // namespace oted
