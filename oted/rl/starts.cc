#include "oted/rl/starts.h"

#include <fmt/format.h>

#include <atomic>
#include <numeric>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/parallel.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

/// Progress of the starts goes to the run's log as that of one agent. Their curves do not: only the chosen one's is the
/// agent's.
class StartsProgress {
 public:
  /// @param total  control steps of all starts and of what follows the chosen one
  StartsProgress(const AgentJob& job, int n_starts, int64_t total)
      : log_(*job.context.log), label_(job.run_name), total_(total), done_(static_cast<size_t>(n_starts)) {}
  /// What start `k` logs to; used from one thread each.
  std::unique_ptr<LogSink> SinkOf(int k) { return std::make_unique<Sink>(*this, static_cast<size_t>(k)); }

 private:
  class Sink : public LogSink {
   public:
    Sink(StartsProgress& all, size_t k) : all_(all), k_(k) {}
    void Scalar(std::string_view, std::string_view, int64_t, double) override {}
    void Progress(std::string_view stage, std::string_view, int64_t done, int64_t, std::string_view note) override {
      all_.done_[k_] = done;
      const int64_t sum = std::accumulate(all_.done_.begin(), all_.done_.end(), int64_t{0});
      all_.log_.Progress(stage, all_.label_, sum, all_.total_,
                         note.empty() ? "" : fmt::format("start {}: {}", k_ + 1, note));
    }
    void Warning(std::string_view message) override { all_.log_.Warning(message); }

   private:
    StartsProgress& all_;
    size_t k_;
  };

  LogSink& log_;
  std::string label_;
  int64_t total_;
  std::vector<std::atomic<int64_t>> done_;
};

struct Started {
  std::unique_ptr<EpisodeSource> source;
  std::unique_ptr<Learner> learner;
  LearningCurve curve;
};

fs::path FolderOf(const AgentJob& job, int k) { return job.folder / kStartsFolder / std::to_string(k + 1); }

Started Train(const AgentJob& job, const TrainingSchedule& schedule, int k, StartsProgress& progress,
              const MakeLearner& make) {
  const std::unique_ptr<LogSink> log = progress.SinkOf(k);
  AgentJob start = job;
  start.folder = FolderOf(job, k);
  start.run_name = fmt::format("{}, start {}", job.run_name, k + 1);
  start.context.log = log.get();
  start.observer = {};
  Started started;
  started.source = job.source.Clone();
  started.learner =
      make(*started.source, job.key.Stage("start").Index(static_cast<uint64_t>(k)), job.context.n_threads);
  started.curve = TrainInSegments(*started.learner, start, schedule);
  return started;
}

}  // namespace

int64_t ChooseStart(const AgentJob& job, const TrainingSchedule& schedule, const Starts& starts,
                    const MakeLearner& make) {
  const auto forget_starts = [&] { fs::remove_all(job.folder / kStartsFolder); };
  if (starts.n == 1 || schedule.n_steps <= starts.n_steps) return 0;
  const int64_t steps_of_others = (starts.n - 1) * starts.n_steps;
  if (fs::exists(job.folder / "checkpoint.npz")) {
    forget_starts();
    return steps_of_others;
  }
  TrainingSchedule until = schedule;
  until.n_steps = until.eval_interval = starts.n_steps;
  AgentJob share = job;
  share.context = job.context.ShareOf(static_cast<size_t>(starts.n));
  std::vector<Started> started(static_cast<size_t>(starts.n));
  StartsProgress progress(job, starts.n, steps_of_others + schedule.n_steps);
  ParallelFor(starts.n, job.context.n_threads,
              [&](int k) { started[static_cast<size_t>(k)] = Train(share, until, k, progress, make); });
  const auto evaluated = [](const Started& s) { return EvaluatedReturn{s.curve.eval_return, s.curve.always_diverged}; };
  size_t best = 0;
  for (size_t k = 1; k < started.size(); ++k) {
    if (evaluated(started[k]).IsBetterThan(evaluated(started[best]))) best = k;
  }
  const LearningCurve& curve = started[best].curve;
  const int64_t step = curve.eval_steps.back();
  if (job.observer) job.observer(step, *started[best].learner->MakePolicy(curve.kept), curve.eval_return);
  job.context.log->Scalar(job.run_name, "eval/mean_reward", step, curve.eval_return);
  fs::rename(FolderOf(job, static_cast<int>(best)) / "checkpoint.npz", job.folder / "checkpoint.npz");
  forget_starts();
  return steps_of_others;
}

}  // namespace oted
