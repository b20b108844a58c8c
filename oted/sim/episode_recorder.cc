#include "oted/sim/episode_recorder.h"

namespace oted {
namespace {

double Rounded(double value, LogPrecision precision) {
  return precision == LogPrecision::kFloat ? static_cast<double>(static_cast<float>(value)) : value;
}

std::vector<double> Rounded(std::span<const double> values, LogPrecision precision) {
  std::vector<double> rounded;
  for (const double value : values) rounded.push_back(Rounded(value, precision));
  return rounded;
}

}  // namespace

StepObserver EpisodeRecorder::Observer() {
  return [this](const StepView& step) { Record(step); };
}

void EpisodeRecorder::Record(const StepView& step) {
  Dataset& log = lanes_.at(static_cast<size_t>(step.lane));
  if (step.status == LaneStatus::kDiverged) {
    ++n_diverged_;
    if (!log.timeouts.empty()) log.timeouts.back() = 1;
    return;
  }
  log.observations.AppendRow(Rounded(step.observation, precision_));
  log.actions.AppendRow(step.action);
  log.next_observations.AppendRow(Rounded(step.next_observation, precision_));
  if (has_reward_) log.rewards.push_back(Rounded(step.reward, precision_));
  log.terminals.push_back(step.status == LaneStatus::kTerminated);
  log.timeouts.push_back(step.status == LaneStatus::kTruncated);
}

Dataset EpisodeRecorder::Logs() const {
  Dataset logs;
  for (const Dataset& lane : lanes_) {
    if (lane.size() > 0) logs.Append(lane);
  }
  return logs;
}

}  // namespace oted
