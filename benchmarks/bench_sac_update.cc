// What a whole gradient step of SAC costs beside its matrix products alone: the rest is what a faster Step could save.
// Run: bench_sac_update --benchmark_enable_random_interleaving=true --benchmark_repetitions=15
// items_per_second counts updates; one thread.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "oted/nn/gemm.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/sac_update.h"

namespace oted {
namespace {

constexpr int kBatch = 256;
constexpr int kRows = 10'000;  // of the replay buffer
const std::vector<int> kHidden = {256, 256};

void Update(benchmark::State& state, int obs_dim, int act_dim) {
  Rng rng(1);
  ReplayBuffer buffer(obs_dim, act_dim, kRows);
  std::vector<double> s(static_cast<size_t>(obs_dim)), a(static_cast<size_t>(act_dim)), s2(s.size());
  for (int row = 0; row < kRows; ++row) {
    for (std::vector<double>* values : {&s, &s2}) {
      for (double& value : *values) value = rng.Normal();
    }
    for (double& value : a) value = rng.Uniform(-1, 1);
    buffer.Add(s, a, rng.Normal(), s2, row % 100 == 99);
  }
  TanhGaussianPolicy actor(Normalizer{std::vector<double>(s.size(), 0.0), std::vector<double>(s.size(), 1.0)}, kHidden,
                           std::vector<double>(a.size(), -1.0), std::vector<double>(a.size(), 1.0));
  actor.net().Initialize(rng);
  SacUpdate update(actor, kHidden, {.target_entropy = -static_cast<double>(act_dim)}, rng);
  SacBatch batch;
  for (auto _ : state) {
    buffer.Sample(kBatch, rng, batch);
    benchmark::DoNotOptimize(update.Step(batch));
  }
  state.SetItemsProcessed(state.iterations());
}

// The products of one network on arrays of the sizes that the update has.
class Products {
 public:
  Products(int in, int out) {
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
      Gemm(Op::kNone, Op::kNone, batch, out, in, x_.data(), in, weight_.data(), out, 0.0f, y_.data(), out);
    }
  }

  // `dx`: how many columns of the input's gradient are wanted.
  void Backward(bool parameter_gradient, int dx) {
    for (size_t l = layers_.size(); l-- > 0;) {
      const auto& [in, out] = layers_[l];
      if (parameter_gradient) {
        Gemm(Op::kTranspose, Op::kNone, in, out, kBatch, x_.data(), in, weight_.data(), out, 0.0f, y_.data(), out);
      }
      const int columns = l == 0 ? dx : in;
      if (columns == 0) continue;
      Gemm(Op::kNone, Op::kTranspose, kBatch, columns, out, x_.data(), out, weight_.data(), out, 0.0f, y_.data(),
           columns);
    }
  }

 private:
  struct Size {
    int in, out;
  };
  std::vector<Size> layers_;
  AlignedVector<float> x_, weight_, y_;
};

// SacUpdate::Step's calls of Gemm, in its order.
void MatrixProducts(benchmark::State& state, int obs_dim, int act_dim) {
  Products actor(obs_dim, 2 * act_dim);
  Products critic(obs_dim + act_dim, 1);
  for (auto _ : state) {
    actor.Forward(2 * kBatch);                           // a, a'
    for (int i = 0; i < 2; ++i) critic.Forward(kBatch);  // Q'_i(s', a')
    for (int i = 0; i < 2; ++i) {                        // the critics' step
      critic.Forward(kBatch);
      critic.Backward(true, 0);
    }
    for (int i = 0; i < 2; ++i) critic.Forward(kBatch);  // the actor's step
    for (int i = 0; i < 2; ++i) critic.Backward(false, act_dim);
    actor.Backward(true, 0);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK_CAPTURE(Update, Hopper, 11, 3);
BENCHMARK_CAPTURE(MatrixProducts, Hopper, 11, 3);
BENCHMARK_CAPTURE(Update, HalfCheetah, 17, 6);
BENCHMARK_CAPTURE(MatrixProducts, HalfCheetah, 17, 6);

}  // namespace
}  // namespace oted
