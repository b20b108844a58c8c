#include "oted/rl/training_lanes.h"

#include <algorithm>
#include <cstdint>

namespace oted {
namespace {

/// An episode may be this long [control steps]: what it was made of must fit into a checkpoint.
constexpr int kLongestEpisode = 100'000;

}  // namespace

TrainingLanes::TrainingLanes(const SimulatorFactory& factory, EpisodeSource& source, int n_lanes, int n_threads)
    : source_(source),
      simulator_(factory.Make(n_lanes, n_threads)),
      episodes_(n_lanes),
      all_(static_cast<size_t>(n_lanes)),
      lanes_(all_.size()) {
  std::iota(all_.begin(), all_.end(), 0);
}

bool TrainingLanes::EpisodesEnd() const {
  const int limit = simulator_->spec().max_episode_steps;
  return limit > 0 && limit <= kLongestEpisode;
}

void TrainingLanes::Begin(int lane, Rng& rng) {
  Lane& l = lanes_[static_cast<size_t>(lane)];
  l.z = source_.Draw(lane, rng);
  l.start = rng.state();
  l.actions.clear();
  simulator_->SetParameters(lane, l.z);
  simulator_->Reset(lane, rng);
}

void TrainingLanes::BeginSegment(Rng& rng) {
  episodes_.BeginSegment();
  if (has_begun_ && EpisodesEnd()) return;
  for (const int lane : all_) {
    episodes_.Forget(lane);
    Begin(lane, rng);
  }
  has_begun_ = true;
}

void TrainingLanes::Step(std::span<const double> actions) {
  const size_t act_dim = actions.size() / lanes_.size();
  for (size_t i = 0; i < lanes_.size(); ++i) {
    const auto action = actions.subspan(i * act_dim, act_dim);
    lanes_[i].actions.insert(lanes_[i].actions.end(), action.begin(), action.end());
  }
  StepLanes(all_, actions);
}

void TrainingLanes::StepLanes(std::span<const int> lanes, std::span<const double> actions) {
  simulator_->Step(lanes, actions);
  for (const int lane : lanes) {
    if (simulator_->status(lane) != LaneStatus::kDiverged) episodes_.AddStep(lane, simulator_->reward(lane));
  }
}

void TrainingLanes::Next(int lane, Rng& rng) {
  source_.EpisodeEnded(lane, episodes_.EndEpisode(lane), simulator_->status(lane) == LaneStatus::kDiverged);
  Begin(lane, rng);
}

void TrainingLanes::Save(NpzArrays& arrays) const {
  std::vector<double> z, actions;
  std::vector<int64_t> starts, lengths;
  for (const Lane& lane : lanes_) {
    z.insert(z.end(), lane.z.begin(), lane.z.end());
    for (const uint64_t word : lane.start) starts.push_back(static_cast<int64_t>(word));
    lengths.push_back(static_cast<int64_t>(lane.actions.size()));
    actions.insert(actions.end(), lane.actions.begin(), lane.actions.end());
  }
  arrays["lanes/z"] = NpyArray(z);
  arrays["lanes/start"] = NpyArray(starts);
  arrays["lanes/lengths"] = NpyArray(lengths);
  arrays["lanes/actions"] = NpyArray(actions);
}

void TrainingLanes::Restore(const NpzArrays& arrays) {
  const SimulatorSpec& spec = simulator_->spec();
  const size_t n = lanes_.size(), act_dim = spec.n_discrete_actions > 0 ? 1 : static_cast<size_t>(spec.act_dim);
  const size_t n_parameters = static_cast<size_t>(simulator_->parameters().size()), n_words = Rng::State().size();
  const auto& z = CheckpointValues<double>(arrays, "lanes/z", n * n_parameters);
  const auto& starts = CheckpointValues<int64_t>(arrays, "lanes/start", n * n_words);
  const auto& lengths = CheckpointValues<int64_t>(arrays, "lanes/lengths", n);
  size_t n_numbers = 0;
  for (const int64_t length : lengths) {
    const bool fits = length >= 0 && length <= int64_t{kLongestEpisode} * static_cast<int64_t>(act_dim) &&
                      length % static_cast<int64_t>(act_dim) == 0;
    if (!fits && EpisodesEnd()) throw DataError("array 'lanes/lengths' holds no lengths of episodes");
    n_numbers += static_cast<size_t>(length);
  }
  has_begun_ = EpisodesEnd();
  if (!has_begun_) return;
  const auto& actions = CheckpointValues<double>(arrays, "lanes/actions", n_numbers);
  auto first = actions.begin();
  size_t n_steps = 0;
  for (size_t i = 0; i < n; ++i) {
    Lane& lane = lanes_[i];
    const auto own = z.begin() + static_cast<ptrdiff_t>(i * n_parameters);
    lane.z.assign(own, own + static_cast<ptrdiff_t>(n_parameters));
    for (size_t k = 0; k < n_words; ++k) lane.start[k] = static_cast<uint64_t>(starts[i * n_words + k]);
    lane.actions.assign(first, first + lengths[i]);
    first += lengths[i];
    n_steps = std::max(n_steps, lane.actions.size() / act_dim);
    Rng rng(0);
    rng.set_state(lane.start);
    simulator_->SetParameters(all_[i], lane.z);
    simulator_->Reset(all_[i], rng);
  }
  std::vector<double> now(n * act_dim);
  for (size_t t = 0; t < n_steps; ++t) {
    std::vector<int> running;
    for (const int lane : all_) {
      const std::vector<double>& own = lanes_[static_cast<size_t>(lane)].actions;
      if ((t + 1) * act_dim > own.size()) continue;
      std::copy_n(own.begin() + static_cast<ptrdiff_t>(t * act_dim), act_dim,
                  now.begin() + static_cast<ptrdiff_t>(lane) * static_cast<ptrdiff_t>(act_dim));
      running.push_back(lane);
    }
    StepLanes(running, now);
  }
}

}  // namespace oted
