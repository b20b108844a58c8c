// What a whole gradient step of SAC costs beside its matrix products alone: the rest is what a faster Step could save.
// The products come from the linked BLAS (libtorch's MKL), the floor that docs/speed.md speaks of, and from our own
// code.
//
// Each iteration makes one update, one set of products by BLAS and one by our own code, one after the other and each
// timed by the thread's CPU time, so that what else the machine does falls on all three alike. Counters: medians of the
// rates per second, and the median and the quartiles of update time / products time within an iteration.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/sac_workload.h"

namespace oted {
namespace {

double Seconds(clockid_t clock, const std::function<void()>& work) {
  const double begin = Now(clock);
  work();
  return Now(clock) - begin;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

void Update(benchmark::State& state, int obs_dim, int act_dim) {
  ReplayWorkload learner(ReplayWorkload::Algorithm::kSac, obs_dim, act_dim);
  Products blas_actor(BlasGemm, obs_dim, 2 * act_dim), blas_critic(BlasGemm, obs_dim + act_dim, 1);
  Products our_actor(OwnGemm, obs_dim, 2 * act_dim), our_critic(OwnGemm, obs_dim + act_dim, 1);
  std::vector<double> update, blas, own, over_blas, over_own;
  for (auto _ : state) {
    update.push_back(Seconds(CLOCK_THREAD_CPUTIME_ID, [&] { learner.Step(); }));
    blas.push_back(Seconds(CLOCK_THREAD_CPUTIME_ID, [&] { MultiplyAll(blas_actor, blas_critic, act_dim); }));
    own.push_back(Seconds(CLOCK_THREAD_CPUTIME_ID, [&] { MultiplyAll(our_actor, our_critic, act_dim); }));
    over_blas.push_back(update.back() / blas.back());
    over_own.push_back(update.back() / own.back());
  }
  state.counters["updates"] = 1 / Quantile(update, 0.5);
  state.counters["blas_products"] = 1 / Quantile(blas, 0.5);
  state.counters["own_products"] = 1 / Quantile(own, 0.5);
  state.counters["over_blas"] = Quantile(over_blas, 0.5);
  state.counters["over_blas_q1"] = Quantile(over_blas, 0.25);
  state.counters["over_blas_q3"] = Quantile(over_blas, 0.75);
  state.counters["over_own"] = Quantile(over_own, 0.5);
}

// What a step of one learner costs beside one of another, each the mean of three: CrossQ's actor learns in every third.
// By the wall clock, as what a GPU does is no CPU time.
void Beside(benchmark::State& state, ReplayWorkload learner, ReplayWorkload other) {
  const auto three = [](ReplayWorkload& of) {
    return Seconds(CLOCK_MONOTONIC, [&] {
      for (int i = 0; i < 3; ++i) of.Step();
    });
  };
  std::vector<double> of_learner, of_other, ratio;
  for (auto _ : state) {
    of_learner.push_back(three(learner) / 3);
    of_other.push_back(three(other) / 3);
    ratio.push_back(of_learner.back() / of_other.back());
  }
  state.counters["updates"] = 1 / Quantile(of_learner, 0.5);
  state.counters["other_updates"] = 1 / Quantile(of_other, 0.5);
  state.counters["ratio"] = Quantile(ratio, 0.5);
  state.counters["ratio_q1"] = Quantile(ratio, 0.25);
  state.counters["ratio_q3"] = Quantile(ratio, 0.75);
}

constexpr auto kSac = ReplayWorkload::Algorithm::kSac, kCrossQ = ReplayWorkload::Algorithm::kCrossQ;

void CrossQBesideSac(benchmark::State& state, int obs_dim, int act_dim) {
  Beside(state, {kCrossQ, obs_dim, act_dim}, {kSac, obs_dim, act_dim});
}

// The hand-written step on one core beside the same one on libtorch's autograd: what --device cuda runs, here or there.
// The argument is the batch.
void Autograd(benchmark::State& state, ReplayWorkload::Algorithm algorithm, TrainingDevice device) {
  try {
    CheckDevice(device);
  } catch (const std::exception& error) {
    state.SkipWithError(error.what());
    return;
  }
  const auto batch = static_cast<int>(state.range(0));
  Beside(state, {algorithm, 11, 3, device, batch}, {algorithm, 11, 3, std::nullopt, batch});
}

constexpr int kFewSteps = 15;  // of large batches

void OfManySizes(benchmark::internal::Benchmark* benchmark) {
  for (const int batch : {256, 1024, 4096, 16384, 32768}) benchmark->Arg(batch);
}

BENCHMARK_CAPTURE(Update, Hopper, 11, 3)->Iterations(100);
BENCHMARK_CAPTURE(Update, HalfCheetah, 17, 6)->Iterations(100);
BENCHMARK_CAPTURE(CrossQBesideSac, Hopper, 11, 3)->Iterations(100);
BENCHMARK_CAPTURE(CrossQBesideSac, HalfCheetah, 17, 6)->Iterations(100);
BENCHMARK_CAPTURE(Autograd, SacOnCpu, kSac, TrainingDevice::kCpu)->Arg(256)->Iterations(100);
BENCHMARK_CAPTURE(Autograd, SacOnCuda, kSac, TrainingDevice::kCuda)->Apply(OfManySizes)->Iterations(kFewSteps);
BENCHMARK_CAPTURE(Autograd, CrossQOnCpu, kCrossQ, TrainingDevice::kCpu)->Arg(256)->Iterations(100);
BENCHMARK_CAPTURE(Autograd, CrossQOnCuda, kCrossQ, TrainingDevice::kCuda)->Apply(OfManySizes)->Iterations(kFewSteps);

}  // namespace
}  // namespace oted
