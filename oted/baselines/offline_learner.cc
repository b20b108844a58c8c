#include "oted/baselines/offline_learner.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/data/checkpoint_curves.h"

namespace oted {
namespace {

constexpr int64_t kInterval = 2'000;   // steps between points of the curves and between checkpoints
constexpr int64_t kStopInterval = 50;  // steps between looks at whether to stop

void SaveCheckpoint(OfflineLearner& learner, const OfflineJob& job, const std::filesystem::path& path) {
  NpzArrays arrays;
  learner.Save(arrays);
  KeepCurvesMark(*job.context.log, job.run_name, arrays);
  WriteCheckpoint(arrays, path);
}

void RestoreCheckpoint(OfflineLearner& learner, const OfflineJob& job, const std::filesystem::path& path) {
  const NpzArrays arrays = ReadCheckpoint(path);
  try {
    learner.Restore(arrays);
  } catch (const std::exception& e) {
    // Whatever a file makes fail here is the file's fault, or that of a configuration which is not its own.
    throw DataError(fmt::format("checkpoint '{}' does not fit this baseline ({}); remove it to start anew",
                                path.string(), e.what()));
  }
  GoOnWithCurves(*job.context.log, job.run_name, arrays);
}

}  // namespace

OfflineResult LearnOffline(OfflineLearner& learner, const OfflineJob& job) {
  const RunContext& context = job.context;
  const std::filesystem::path path = job.folder / "checkpoint.npz";
  if (std::filesystem::exists(path)) RestoreCheckpoint(learner, job, path);
  const auto progress = [&] {
    const auto losses = learner.Losses();
    context.log->Progress("train", job.run_name, learner.n_steps(), learner.total(),
                          losses.empty() ? "" : fmt::format("{} {:.3g}", losses[0].first, losses[0].second));
  };
  progress();
  while (learner.n_steps() < learner.total()) {
    learner.Step();
    const int64_t step = learner.n_steps();
    const bool is_point = step % kInterval == 0 || step == learner.total();
    if (is_point) {
      for (const auto& [name, value] : learner.Losses()) {
        context.log->Scalar(job.run_name, name, step, value);
        if (std::isfinite(value)) continue;
        throw DataError(fmt::format("'{}' diverged: after {} steps its {} is {}; lower its learning_rate", job.run_name,
                                    step, name, value));
      }
    }
    if (is_point || step % kStopInterval == 0) progress();
    const bool stops = (is_point || step % kStopInterval == 0) && context.StopRequested();
    if (is_point || stops) SaveCheckpoint(learner, job, path);
    if (stops) context.ThrowIfStopped();
  }
  return {learner.MakePolicy(), learner.Losses()};
}

}  // namespace oted
