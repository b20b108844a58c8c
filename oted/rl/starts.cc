#include "oted/rl/starts.h"

#include <fmt/format.h>

#include <string>

#include "oted/base/files.h"
#include "oted/base/parallel.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

/// Progress of a start goes to the run's log. Its curve does not: only the chosen one's is the agent's.
class ProgressOnly : public LogSink {
 public:
  explicit ProgressOnly(LogSink& log) : log_(log) {}
  void Scalar(std::string_view, std::string_view, int64_t, double) override {}
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    log_.Progress(stage, label, done, total, note);
  }
  void Warning(std::string_view message) override { log_.Warning(message); }

 private:
  LogSink& log_;
};

struct Started {
  std::unique_ptr<EpisodeSource> source;
  std::unique_ptr<Learner> learner;
  LearningCurve curve;
};

fs::path FolderOf(const AgentJob& job, int k) { return job.folder / kStartsFolder / std::to_string(k + 1); }

Started Train(const AgentJob& job, const TrainingSchedule& schedule, int k, const MakeLearner& make) {
  ProgressOnly log(*job.context.log);
  AgentJob start = job;
  start.folder = FolderOf(job, k);
  start.run_name = fmt::format("{}, start {}", job.run_name, k + 1);
  start.context.log = &log;
  start.observer = {};
  Started started;
  started.source = job.source.Clone();
  started.learner =
      make(*started.source, job.key.Stage("start").Index(static_cast<uint64_t>(k)), job.context.n_threads);
  started.curve = TrainInSegments(*started.learner, start, schedule);
  return started;
}

}  // namespace

void ChooseStart(const AgentJob& job, const TrainingSchedule& schedule, const Starts& starts, const MakeLearner& make) {
  const auto forget_starts = [&] { fs::remove_all(job.folder / kStartsFolder); };
  if (starts.n == 1 || schedule.n_steps <= starts.n_steps) return;
  if (fs::exists(job.folder / "checkpoint.npz")) return forget_starts();
  TrainingSchedule until = schedule;
  until.n_steps = until.eval_interval = starts.n_steps;
  AgentJob share = job;
  share.context = job.context.ShareOf(static_cast<size_t>(starts.n));
  std::vector<Started> started(static_cast<size_t>(starts.n));
  ParallelFor(starts.n, job.context.n_threads,
              [&](int k) { started[static_cast<size_t>(k)] = Train(share, until, k, make); });
  const auto failed = [&](const Started& s) { return s.curve.n_diverged == schedule.eval_episodes; };
  size_t best = 0;
  for (size_t k = 1; k < started.size(); ++k) {
    const Started &now = started[best], &other = started[k];
    const bool better = failed(other) != failed(now) ? failed(now) : other.curve.eval_return > now.curve.eval_return;
    if (better) best = k;
  }
  const LearningCurve& curve = started[best].curve;
  const int64_t step = curve.eval_steps.back();
  if (job.observer) job.observer(step, *started[best].learner->MakePolicy(curve.kept), curve.eval_return);
  job.context.log->Scalar(job.run_name, "eval/mean_reward", step, curve.eval_return);
  fs::rename(FolderOf(job, static_cast<int>(best)) / "checkpoint.npz", job.folder / "checkpoint.npz");
  forget_starts();
}

}  // namespace oted
