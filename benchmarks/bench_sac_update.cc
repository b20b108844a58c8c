// What a whole gradient step of SAC costs beside its matrix products alone: the rest is what a faster Step could save.
// The products come from the linked BLAS (libtorch's MKL), the floor that docs/speed.md speaks of, and from our own
// code.
//
// Each iteration makes one update, one set of products by BLAS and one by our own code, one after the other and each
// timed by the thread's CPU time, so that what else the machine does falls on all three alike. Counters: medians of the
// rates per second, and the median and the quartiles of update time / products time within an iteration.

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "benchmarks/sac_workload.h"

namespace oted {
namespace {

double CpuSeconds(const std::function<void()>& work) {
  const auto now = [] {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double begin = now();
  work();
  return now() - begin;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

void Update(benchmark::State& state, int obs_dim, int act_dim) {
  ReplayWorkload learner(ReplayWorkload::Algorithm::kSac, obs_dim, act_dim);
  Products blas_actor(GemmKernel::kBlas, obs_dim, 2 * act_dim), blas_critic(GemmKernel::kBlas, obs_dim + act_dim, 1);
  const GemmKernel ours = GemmKernels().front();
  Products our_actor(ours, obs_dim, 2 * act_dim), our_critic(ours, obs_dim + act_dim, 1);
  std::vector<double> update, blas, own, over_blas, over_own;
  for (auto _ : state) {
    update.push_back(CpuSeconds([&] { learner.Step(); }));
    blas.push_back(CpuSeconds([&] { MultiplyAll(blas_actor, blas_critic, act_dim); }));
    own.push_back(CpuSeconds([&] { MultiplyAll(our_actor, our_critic, act_dim); }));
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

// What a step of CrossQ costs beside one of SAC, each the mean of three: CrossQ's actor learns in every third.
void CrossQ(benchmark::State& state, int obs_dim, int act_dim) {
  ReplayWorkload sac(ReplayWorkload::Algorithm::kSac, obs_dim, act_dim);
  ReplayWorkload crossq(ReplayWorkload::Algorithm::kCrossQ, obs_dim, act_dim);
  const auto three = [](ReplayWorkload& learner) {
    return CpuSeconds([&] {
      for (int i = 0; i < 3; ++i) learner.Step();
    });
  };
  std::vector<double> of_sac, of_crossq, ratio;
  for (auto _ : state) {
    of_sac.push_back(three(sac) / 3);
    of_crossq.push_back(three(crossq) / 3);
    ratio.push_back(of_crossq.back() / of_sac.back());
  }
  state.counters["sac_updates"] = 1 / Quantile(of_sac, 0.5);
  state.counters["crossq_updates"] = 1 / Quantile(of_crossq, 0.5);
  state.counters["over_sac"] = Quantile(ratio, 0.5);
  state.counters["over_sac_q1"] = Quantile(ratio, 0.25);
  state.counters["over_sac_q3"] = Quantile(ratio, 0.75);
}

BENCHMARK_CAPTURE(Update, Hopper, 11, 3)->Iterations(100);
BENCHMARK_CAPTURE(Update, HalfCheetah, 17, 6)->Iterations(100);
BENCHMARK_CAPTURE(CrossQ, Hopper, 11, 3)->Iterations(100);
BENCHMARK_CAPTURE(CrossQ, HalfCheetah, 17, 6)->Iterations(100);

}  // namespace
}  // namespace oted
