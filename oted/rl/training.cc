#include "oted/rl/training.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "oted/base/statistics.h"
#include "oted/data/checkpoint_curves.h"
#include "oted/rl/evaluations.h"

namespace oted {

const NamedValues<KeptPolicy>& KeptPolicyNames() {
  static const NamedValues<KeptPolicy> names = {{KeptPolicy::kBest, "best"}, {KeptPolicy::kLast, "last"}};
  return names;
}

const NamedValues<TrainingDevice>& TrainingDeviceNames() {
  static const NamedValues<TrainingDevice> names = {{TrainingDevice::kCpu, "cpu"}, {TrainingDevice::kCuda, "cuda"}};
  return names;
}

void EpisodeStatistics::BeginSegment() {
  returns_.clear();
  lengths_.clear();
}

void EpisodeStatistics::Forget(int lane) { lanes_[static_cast<size_t>(lane)] = {}; }

void EpisodeStatistics::AddStep(int lane, double reward) {
  Running& running = lanes_[static_cast<size_t>(lane)];
  running.episode_return += reward;
  running.length += 1;
}

double EpisodeStatistics::EndEpisode(int lane) {
  Running& running = lanes_[static_cast<size_t>(lane)];
  returns_.push_back(running.episode_return);
  lengths_.push_back(running.length);
  running = {};
  return returns_.back();
}

NpyArray RngArray(const Rng& rng) {
  std::vector<int64_t> words;
  for (const uint64_t word : rng.state()) words.push_back(static_cast<int64_t>(word));
  return NpyArray(words);
}

void RestoreRng(const NpzArrays& arrays, const char* name, Rng& rng) {
  Rng::State state;
  const auto& words = CheckpointValues<int64_t>(arrays, name, state.size());
  for (size_t i = 0; i < state.size(); ++i) state[i] = static_cast<uint64_t>(words[i]);
  rng.set_state(state);
}

namespace {

using NamedFigures = std::vector<std::pair<std::string, double>>;

/// A live figure: a grid world's returns lie below 1, a locomotion task's in the thousands.
std::string ReturnNote(double eval_return) {
  return fmt::format("return {:.{}f}", eval_return, std::abs(eval_return) < 10 ? 3 : 0);
}

NamedFigures Figures(const Learner& learner) {
  NamedFigures figures;
  if (!learner.episodes().returns().empty()) {
    figures = {{"rollout/ep_rew_mean", Mean(learner.episodes().returns())},
               {"rollout/ep_len_mean", Mean(learner.episodes().lengths())}};
  }
  for (auto& figure : learner.Losses()) figures.push_back(std::move(figure));
  return figures;
}

/// A checkpoint grows with the replay: the next one is due after this part of the control steps made until then.
constexpr int64_t kCheckpointsApart = 20;

constexpr std::string_view kFigures = "figures/";

/// @param figures  of the last segment, whose evaluation may still be under way
void SaveCheckpoint(Learner& learner, const LearningCurve& curve, const NamedFigures& figures, const AgentJob& job) {
  NpzArrays arrays;
  learner.Save(arrays);
  for (const auto& [name, value] : figures) {
    arrays[std::string(kFigures) + name] = NpyArray(std::vector<double>{value});
  }
  arrays["n_figures"] = NpyArray(std::vector<int64_t>{static_cast<int64_t>(figures.size())});
  arrays["eval/steps"] = NpyArray(curve.eval_steps);
  arrays["eval/returns"] = NpyArray(curve.eval_returns);
  arrays["eval/best"] = NpyArray(std::vector<double>{curve.eval_return, static_cast<double>(curve.n_diverged)});
  arrays["best"] = NpyArray(curve.kept);
  arrays["key"] = NpyArray(std::vector<int64_t>{static_cast<int64_t>(job.key.value())});
  KeepCurvesMark(*job.context.log, job.run_name, arrays);
  WriteCheckpoint(arrays, job.folder / "checkpoint.npz");
}

NamedFigures RestoreCheckpoint(Learner& learner, LearningCurve& curve, const AgentJob& job) {
  const std::filesystem::path path = job.folder / "checkpoint.npz";
  NamedFigures figures;
  NpzArrays arrays;
  try {
    arrays = ReadCheckpoint(path);
    if (static_cast<uint64_t>(CheckpointValues<int64_t>(arrays, "key", 1)[0]) != job.key.value()) {
      throw DataError("it is another agent's");
    }
    learner.Restore(arrays);
    for (const auto& [name, unused] : arrays) {
      if (!name.starts_with(kFigures)) continue;
      figures.emplace_back(name.substr(kFigures.size()), CheckpointValues<double>(arrays, name, 1)[0]);
    }
    if (CheckpointValues<int64_t>(arrays, "n_figures", 1)[0] != std::ssize(figures)) {
      throw DataError("an array of figures is missing");
    }
    curve.eval_steps = std::get<std::vector<int64_t>>(arrays.at("eval/steps").values);
    curve.eval_returns = CheckpointValues<double>(arrays, "eval/returns", curve.eval_steps.size());
    const auto& best = CheckpointValues<double>(arrays, "eval/best", 2);
    curve.eval_return = best[0];
    curve.n_diverged = static_cast<int>(best[1]);
    const size_t n_kept = curve.eval_steps.empty() ? 0 : learner.PolicyParameters().size();
    curve.kept = CheckpointValues<float>(arrays, "best", n_kept);
  } catch (const std::exception& e) {
    // Whatever a file makes fail here is the file's fault, or that of a configuration which is not its own.
    throw DataError(fmt::format("checkpoint '{}' does not fit this agent ({}); remove it to start the agent anew",
                                path.string(), e.what()));
  }
  GoOnWithCurves(*job.context.log, job.run_name, arrays);
  return figures;
}

}  // namespace

void CheckStillLearns(double losses, std::string_view section, double learning_rate, int64_t n_steps) {
  if (std::isfinite(losses)) return;
  throw DataError(
      fmt::format("the networks of {0} diverged after {1} control steps: a loss is not finite; lower {0}.learning_rate "
                  "(it is {2:g}), or look for rewards that are too large",
                  section, n_steps, learning_rate));
}

LearningCurve TrainInSegments(Learner& learner, const AgentJob& job, const TrainingSchedule& schedule) {
  LearningCurve curve;
  const RunContext& context = job.context;
  Evaluations evaluations(job, schedule, curve);
  NamedFigures figures;
  if (std::filesystem::exists(job.folder / "checkpoint.npz")) {
    figures = RestoreCheckpoint(learner, curve, job);
    // A run that was killed may have left a segment without its evaluation.
    if (curve.eval_steps.empty() || curve.eval_steps.back() < learner.n_steps()) evaluations.Begin(learner, figures);
  }
  const auto progress = [&] {
    evaluations.FinishIfReady();
    context.log->Progress("train", job.run_name, job.steps_beside + std::min(learner.n_steps(), schedule.n_steps),
                          job.steps_beside + schedule.n_steps,
                          curve.eval_returns.empty() ? "" : ReturnNote(curve.eval_returns.back()));
  };
  int64_t saved = learner.n_steps();
  while (learner.n_steps() < schedule.n_steps) {
    learner.RunSegment(std::min(schedule.n_steps, learner.n_steps() + schedule.eval_interval), progress);
    evaluations.Finish();
    figures = Figures(learner);
    evaluations.Begin(learner, figures);
    progress();
    const int64_t n = learner.n_steps();
    const bool stops = context.StopRequested();
    if (n - saved >= n / kCheckpointsApart || n >= schedule.n_steps || stops) {
      SaveCheckpoint(learner, curve, figures, job);
      saved = n;
    }
    if (!stops) continue;
    if (evaluations.Finish()) SaveCheckpoint(learner, curve, figures, job);
    context.ThrowIfStopped();
  }
  if (evaluations.Finish()) SaveCheckpoint(learner, curve, figures, job);
  progress();
  curve.always_diverged = curve.n_diverged == schedule.eval_episodes;
  return curve;
}

}  // namespace oted
