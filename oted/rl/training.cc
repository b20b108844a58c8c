#include "oted/rl/training.h"

#include <algorithm>
#include <cmath>

#include "oted/base/statistics.h"
#include "oted/rl/batch_policy.h"

namespace oted {

void StartEpisode(Simulator& simulator, int lane, EpisodeSource& source, Rng& rng) {
  simulator.SetParameters(lane, source.Draw(lane, rng));
  simulator.Reset(lane, rng);
}

void EpisodeStatistics::Begin() {
  lanes_.assign(lanes_.size(), {});
  returns_.clear();
  lengths_.clear();
}

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

std::vector<EpisodeResult> RunPolicy(const SimulatorFactory& factory, const Policy& policy,
                                     const std::vector<std::vector<double>>& z, int n_episodes, int n_threads,
                                     RngKey key, ActionNoise noise) {
  OTED_CHECK(!z.empty());
  const auto simulator = factory.Make(n_episodes, n_threads);
  std::vector<std::vector<double>> lane_z;
  for (int k = 0; k < n_episodes; ++k) lane_z.push_back(z[static_cast<size_t>(k) % z.size()]);
  return RunEpisodes(*simulator, lane_z, AsBatchPolicy(policy, noise, key.Stage("actions").MakeRng()), key);
}

double EvaluatePolicy(const SimulatorFactory& factory, const Policy& policy, const std::vector<std::vector<double>>& z,
                      int n_episodes, int n_threads, RngKey key, ActionNoise noise) {
  return MeanReturn(RunPolicy(factory, policy, z, n_episodes, n_threads, key, noise));
}

namespace {

/// A live figure: a grid world's returns lie below 1, a locomotion task's in the thousands.
std::string ReturnNote(double eval_return) {
  return fmt::format("return {:.{}f}", eval_return, std::abs(eval_return) < 10 ? 3 : 0);
}

void SaveCheckpoint(Learner& learner, const LearningCurve& curve, const std::filesystem::path& folder) {
  NpzArrays arrays;
  learner.Save(arrays);
  arrays["eval/steps"] = NpyArray(curve.eval_steps);
  arrays["eval/returns"] = NpyArray(curve.eval_returns);
  arrays["eval/best"] = NpyArray(std::vector<double>{curve.eval_return, static_cast<double>(curve.n_diverged)});
  arrays["best"] = NpyArray(curve.kept);
  WriteNpz(arrays, folder / "checkpoint.npz");
}

void RestoreCheckpoint(Learner& learner, LearningCurve& curve, const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "checkpoint.npz";
  const NpzArrays arrays = ReadNpz(path);
  try {
    learner.Restore(arrays);
    curve.eval_steps = std::get<std::vector<int64_t>>(arrays.at("eval/steps").values);
    curve.eval_returns = CheckpointValues<double>(arrays, "eval/returns", curve.eval_steps.size());
    const auto& best = CheckpointValues<double>(arrays, "eval/best", 2);
    curve.eval_return = best[0];
    curve.n_diverged = static_cast<int>(best[1]);
    curve.kept = CheckpointValues<float>(arrays, "best", learner.policy_parameters().size());
  } catch (const std::exception& e) {
    // Whatever a file makes fail here is the file's fault, or that of a configuration which is not its own.
    throw DataError(fmt::format("checkpoint '{}' does not fit this agent ({}); remove it to start the agent anew",
                                path.string(), e.what()));
  }
}

}  // namespace

LearningCurve TrainInSegments(Learner& learner, const SimulatorFactory& factory,
                              const std::vector<std::vector<double>>& eval_parameters, const TrainingSchedule& schedule,
                              RngKey key, const std::filesystem::path& folder, const std::string& run_name,
                              const RunContext& context, const EvaluationObserver& observer) {
  LearningCurve curve;
  if (std::filesystem::exists(folder / "checkpoint.npz")) RestoreCheckpoint(learner, curve, folder);

  while (learner.n_steps() < schedule.n_steps) {
    const int64_t end = std::min(schedule.n_steps, learner.n_steps() + schedule.eval_interval);
    const auto progress = [&] {
      context.log->Progress("train", run_name, std::min(learner.n_steps(), schedule.n_steps), schedule.n_steps,
                            curve.eval_returns.empty() ? "" : ReturnNote(curve.eval_returns.back()));
    };
    learner.RunSegment(end, progress);
    const std::vector<EpisodeResult> episodes =
        RunPolicy(factory, learner.policy(), eval_parameters, schedule.eval_episodes, context.n_threads,
                  key.Stage("evaluation"), schedule.noise);
    const double eval_return = MeanReturn(episodes);
    const int n_diverged = CountDiverged(episodes);
    const auto failed = [&](int n) { return n == schedule.eval_episodes; };
    const bool better =
        failed(n_diverged) != failed(curve.n_diverged) ? failed(curve.n_diverged) : eval_return > curve.eval_return;
    if (schedule.keep == "last" || curve.eval_returns.empty() || better) {
      curve.eval_return = eval_return;
      curve.n_diverged = n_diverged;
      const std::span<const float> parameters = learner.policy_parameters();
      curve.kept.assign(parameters.begin(), parameters.end());
    }
    const int64_t step = learner.n_steps();
    if (observer) observer(step, eval_return);
    curve.eval_steps.push_back(step);
    curve.eval_returns.push_back(eval_return);
    context.log->Scalar(run_name, "eval/mean_reward", step, eval_return);
    context.log->Scalar(run_name, "rollout/ep_rew_mean", step, Mean(learner.episodes().returns()));
    context.log->Scalar(run_name, "rollout/ep_len_mean", step, Mean(learner.episodes().lengths()));
    for (const auto& [name, value] : learner.Losses()) context.log->Scalar(run_name, name, step, value);
    progress();
    SaveCheckpoint(learner, curve, folder);
    context.ThrowIfStopped();
  }
  return curve;
}

}  // namespace oted
