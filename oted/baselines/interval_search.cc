#include "oted/baselines/interval_search.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/rl/policy_evaluation.h"

namespace oted {

namespace {

constexpr int kRandomEpisodes = 16;

}  // namespace

void CheckIntervalSearch(const IntervalSearchConfig& config, const SimulatorSpec& spec) {
  if (config.shrink >= config.grow) {
    throw UsageError(fmt::format(
        "baselines.is_shrink is {}, and baselines.is_grow {}: a bound would move both ways; choose a lower is_shrink",
        config.shrink, config.grow));
  }
  if (config.reference == 0 && !spec.has_score()) {
    throw UsageError(
        fmt::format("interval search grows where the agent does well, and task '{}' does not say what a good return "
                    "is; name one with baselines.is_reference",
                    spec.task));
  }
}

ReturnScale ScaleOf(const SimulatorFactory& factory, const IntervalSearchConfig& config,
                    const std::vector<double>& start, RngKey key) {
  const SimulatorSpec& spec = factory.spec();
  CheckIntervalSearch(config, spec);
  if (config.reference == 0) return {spec.return_random, spec.return_expert};
  Rng rng = key.Stage("actions").MakeRng();
  const PolicyEvaluation random =
      EvaluateBatchPolicy(factory, UniformRandomPolicy(spec, rng), start, kRandomEpisodes, 1, key.Stage("episodes"));
  if (random.mean_return >= config.reference) {
    throw UsageError(
        fmt::format("baselines.is_reference is {}, but random actions return {:.6g} already; name a return that is "
                    "good in task '{}'",
                    config.reference, random.mean_return, spec.task));
  }
  return {random.mean_return, config.reference};
}

IntervalSearch::IntervalSearch(ParameterSpace space, const std::vector<double>& start,
                               const IntervalSearchConfig& config, ReturnScale scale)
    : space_(std::move(space)),
      config_(config),
      scale_(scale),
      start_(space_.ToUnit(start)),
      ends_{start_, start_},
      performances_(2 * start_.size()) {}

std::vector<double> IntervalSearch::Draw(int lane, Rng& rng) {
  std::vector<double> u(start_.size());
  for (size_t i = 0; i < u.size(); ++i) u[i] = rng.Uniform(ends_[0][i], ends_[1][i]);
  at_end_.erase(lane);
  if (rng.Uniform() < config_.boundary) {
    End end{.parameter = rng.Below(u.size()), .side = rng.Below(2)};
    u[end.parameter] = end.value = ends_[end.side][end.parameter];
    at_end_[lane] = end;
  }
  return space_.FromUnit(u);
}

void IntervalSearch::EpisodeEnded(int lane, double episode_return, bool diverged) {
  const auto found = at_end_.find(lane);
  if (found == at_end_.end()) return;
  const End end = found->second;
  at_end_.erase(found);
  if (end.value != ends_[end.side][end.parameter]) return;
  const double performance = scale_.Performance(episode_return);
  PerformancesAt(end).push_back(diverged ? std::min(performance, 0.0) : performance);
  if (PerformancesAt(end).size() >= static_cast<size_t>(config_.episodes)) Decide(end);
}

void IntervalSearch::Decide(const End& end) {
  const double mean = Mean(PerformancesAt(end));
  PerformancesAt(end).clear();
  const double outwards = end.side == 0 ? -config_.step : config_.step, start = start_[end.parameter];
  const double within[2] = {end.side == 0 ? 0.0 : start, end.side == 0 ? start : 1.0};
  double& value = ends_[end.side][end.parameter];
  if (mean >= config_.grow) value = std::clamp(value + outwards, within[0], within[1]);
  if (mean <= config_.shrink) value = std::clamp(value - outwards, within[0], within[1]);
}

std::vector<std::pair<std::string, double>> IntervalSearch::Figures() const {
  std::vector<std::pair<std::string, double>> figures;
  const std::vector<double> low = Low(), high = High();
  for (size_t i = 0; i < low.size(); ++i) {
    const std::string& name = space_[static_cast<int>(i)].name;
    figures.emplace_back("interval/low/" + name, low[i]);
    figures.emplace_back("interval/high/" + name, high[i]);
  }
  return figures;
}

void IntervalSearch::Save(NpzArrays& arrays) const {
  arrays["interval/low"] = NpyArray(ends_[0]);
  arrays["interval/high"] = NpyArray(ends_[1]);
  std::vector<int64_t> counts;
  std::vector<double> values;
  for (const std::vector<double>& at : performances_) {
    counts.push_back(static_cast<int64_t>(at.size()));
    values.insert(values.end(), at.begin(), at.end());
  }
  std::vector<int64_t> lanes;
  std::vector<double> at;
  for (const auto& [lane, end] : at_end_) {
    for (const int64_t number : {int64_t{lane}, static_cast<int64_t>(end.parameter), static_cast<int64_t>(end.side)}) {
      lanes.push_back(number);
    }
    at.push_back(end.value);
  }
  arrays["interval/lanes"] = NpyArray(lanes);
  arrays["interval/at"] = NpyArray(at);
  arrays["interval/counts"] = NpyArray(counts);
  arrays["interval/performances"] = NpyArray(values);
}

void IntervalSearch::Restore(const NpzArrays& arrays) {
  ends_[0] = CheckpointValues<double>(arrays, "interval/low", start_.size());
  ends_[1] = CheckpointValues<double>(arrays, "interval/high", start_.size());
  const auto& at = std::get<std::vector<double>>(arrays.at("interval/at").values);
  const auto& lanes = CheckpointValues<int64_t>(arrays, "interval/lanes", 3 * at.size());
  at_end_.clear();
  for (size_t k = 0; k < at.size(); ++k) {
    const End end{static_cast<size_t>(lanes[3 * k + 1]), static_cast<size_t>(lanes[3 * k + 2]), at[k]};
    if (end.parameter >= start_.size() || end.side > 1) throw DataError("'interval/lanes' is out of range");
    at_end_[static_cast<int>(lanes[3 * k])] = end;
  }
  const auto& counts = CheckpointValues<int64_t>(arrays, "interval/counts", performances_.size());
  int64_t total = 0;
  for (const int64_t count : counts) {
    if (count < 0 || count >= config_.episodes) throw DataError("'interval/counts' is out of range");
    total += count;
  }
  const auto& values = CheckpointValues<double>(arrays, "interval/performances", static_cast<size_t>(total));
  auto next = values.begin();
  for (size_t k = 0; k < counts.size(); ++k, next += counts[k - 1]) performances_[k].assign(next, next + counts[k]);
}

}  // namespace oted
