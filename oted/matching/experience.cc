#include "oted/matching/experience.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "oted/base/error.h"

namespace oted {
namespace {

void AppendFeatures(std::span<const double> s, std::span<const double> a, std::span<const double> s_next,
                    const EvidenceConfig& evidence, const PastActions& before, std::vector<double>& row) {
  row.assign(s.begin(), s.end());
  if (!evidence.actions) return;
  row.insert(row.end(), a.begin(), a.end());
  // The change, not s': over one control period s' is almost s, and the little that differs is the dynamics.
  if (!evidence.transitions) return;
  std::transform(s_next.begin(), s_next.end(), s.begin(), std::back_inserter(row), std::minus<>());
  row.insert(row.end(), before.values().begin(), before.values().end());
}

}  // namespace

PastActions::PastActions(int n_actions, int act_dim)
    : values_(static_cast<size_t>(n_actions) * static_cast<size_t>(act_dim)) {}

void PastActions::Clear() { std::fill(values_.begin(), values_.end(), 0.0); }

void PastActions::Push(std::span<const double> action) {
  if (values_.empty()) return;
  std::copy_backward(values_.begin(), values_.end() - static_cast<ptrdiff_t>(action.size()), values_.end());
  std::copy(action.begin(), action.end(), values_.begin());
}

void StepStack::Push(std::span<const double> step, Array2<double>& samples) {
  if (stack_ == 1) {
    samples.AppendRow(step);
    return;
  }
  steps_.emplace_back(step.begin(), step.end());
  if (static_cast<int>(steps_.size()) < stack_) return;
  std::vector<double> sample;
  size_t n_image = 0;
  if (!image_.empty()) {
    const size_t n_channels = static_cast<size_t>(image_[2]);
    n_image = n_channels * static_cast<size_t>(image_[0] * image_[1]);
    for (size_t p = 0; p < n_image; p += n_channels) {
      for (const auto& one : steps_) {
        sample.insert(sample.end(), one.begin() + static_cast<ptrdiff_t>(p),
                      one.begin() + static_cast<ptrdiff_t>(p + n_channels));
      }
    }
  }
  for (const auto& one : steps_) sample.insert(sample.end(), one.begin() + static_cast<ptrdiff_t>(n_image), one.end());
  samples.AppendRow(sample);
  steps_.clear();
}

Array2<double> DatasetFeatures(const Dataset& dataset, const EvidenceConfig& evidence) {
  Array2<double> features;
  std::vector<double> row;
  PastActions before(evidence.n_past_actions, dataset.act_dim());
  StepStack stack(evidence);
  for (const Episode& episode : dataset.Episodes()) {
    before.Clear();
    stack.Clear();
    const int end = evidence.first_rows ? std::min(episode.end, episode.begin + evidence.horizon) : episode.end;
    for (int i = episode.begin; i < end; ++i) {
      AppendFeatures(dataset.observations.row(i), dataset.actions.row(i), dataset.next_observations.row(i), evidence,
                     before, row);
      stack.Push(row, features);
      before.Push(dataset.actions.row(i));
    }
  }
  return features;
}

InputShape ObservationShape(const SimulatorSpec& spec) {
  return {.image = spec.image_shape, .levels = spec.observation_levels};
}

InputShape FeatureShape(const SimulatorSpec& spec, const EvidenceConfig& evidence) {
  const InputShape shape = ObservationShape(spec);
  const bool has_indices = !shape.levels.empty() || !shape.image.empty() || spec.n_discrete_actions > 0;
  if (!has_indices) return {};
  if (evidence.transitions && (!shape.levels.empty() || !shape.image.empty())) {
    throw UsageError(
        fmt::format("design.adversarial.evidence = \"sas\" takes differences of observations, which mean nothing for "
                    "the images and "
                    "indices of task '{}'; use design.adversarial.evidence = \"sa\"",
                    spec.task));
  }
  InputShape step = shape;
  int n = spec.obs_dim();  // numbers of a step, as AppendFeatures has them
  if (evidence.actions) {
    const std::vector<int> action(static_cast<size_t>(spec.act_dim), spec.n_discrete_actions);
    step = shape.With(n, action);
    n += spec.act_dim;
    if (evidence.transitions) {
      n += spec.obs_dim();  // changes are quantities
      for (int k = 0; k < evidence.n_past_actions; ++k, n += spec.act_dim) step = step.With(n, action);
    }
    if (!step.levels.empty()) step.levels.resize(static_cast<size_t>(n), 0);
  }
  if (evidence.stack == 1) return step;
  InputShape sample;
  const int n_image = step.image_size();
  step.levels.resize(static_cast<size_t>(n), 0);
  const auto add = [&](int begin, int end) {
    sample.levels.insert(sample.levels.end(), step.levels.begin() + begin, step.levels.begin() + end);
  };
  if (n_image > 0) {
    sample.image = {step.image[0], step.image[1], step.image[2] * evidence.stack};
    for (int p = 0; p < n_image; p += step.image[2]) {
      for (int k = 0; k < evidence.stack; ++k) add(p, p + step.image[2]);
    }
  }
  for (int k = 0; k < evidence.stack; ++k) add(n_image, static_cast<int>(step.levels.size()));
  return sample;
}

ExperienceGatherer::ExperienceGatherer(std::unique_ptr<Simulator> simulator, const Dataset& dataset,
                                       const Policy* clone, const EvidenceConfig& config)
    : simulator_(std::move(simulator)), dataset_(dataset), clone_(clone), config_(config) {
  const SimulatorSpec& spec = simulator_->spec();
  OTED_CHECK(config.replayed_actions || clone != nullptr);
  past_actions_.assign(static_cast<size_t>(simulator_->n_lanes()), PastActions(config.n_past_actions, spec.act_dim));
  stacks_.assign(static_cast<size_t>(simulator_->n_lanes()), StepStack(config));
  noise_.assign(static_cast<size_t>(simulator_->n_lanes()), Rng(0));
  if (!config.dataset_starts) {
    OTED_CHECK(!config.replayed_actions);  // replaying from another state than the logged one would prove nothing
    return;
  }
  if (!spec.can_set_state) {
    throw DataError(
        fmt::format("task '{}' cannot be set to a logged state; use --set design.adversarial.starts=initial "
                    "--set design.adversarial.actions=clone",
                    spec.task));
  }
  const std::vector<double> nominal = simulator_->parameters().Nominal();
  simulator_->SetParameters(0, nominal);
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i < episode.end; ++i) {
      const LogWindow window{i, std::min(config.horizon, episode.end - i), episode.begin};
      // A remainder is short where the log was cut, and compared only if the episode itself is shorter than the
      // horizon. Where the task ended the clone's rollout may end as well, sooner or later.
      const bool ends_itself = episode.terminated && !config.replayed_actions;
      if (window.n_steps < config.horizon && i > episode.begin && !ends_itself) break;
      if (simulator_->SetStateFromObservation(0, dataset.observations.row(i))) windows_.push_back(window);
    }
  }
  if (windows_.empty()) {
    throw DataError(
        fmt::format("no state of dataset '{}' can be set in task '{}' (velocities at the observation's clip?); "
                    "use --set design.adversarial.starts=initial --set design.adversarial.actions=clone",
                    dataset.path, spec.task));
  }
}

RngKey ExperienceGatherer::StartKey(int lane, RngKey key) const {
  return config_.common_starts ? key : key.Stage("lane").Index(static_cast<uint64_t>(lane));
}

LogWindow ExperienceGatherer::window(int lane, int n_started, RngKey key) const {
  Rng rng = StartKey(lane, key).Stage("window").Index(static_cast<uint64_t>(n_started)).MakeRng();
  return windows_[rng.Below(windows_.size())];
}

int ExperienceGatherer::RolloutLength(int lane, int n_started, RngKey key) const {
  if (!config_.dataset_starts) return config_.horizon;
  const LogWindow w = window(lane, n_started, key);
  const bool terminated = dataset_.terminals[static_cast<size_t>(w.begin + w.n_steps - 1)] != 0;
  return terminated && !config_.replayed_actions ? config_.horizon : w.n_steps;
}

void ExperienceGatherer::StartRollout(int lane, int n_started, RngKey key) {
  PastActions& before = past_actions_[static_cast<size_t>(lane)];
  before.Clear();
  stacks_[static_cast<size_t>(lane)].Clear();
  noise_[static_cast<size_t>(lane)] =
      StartKey(lane, key).Stage("clone").Index(static_cast<uint64_t>(n_started)).MakeRng();
  if (config_.dataset_starts) {
    const LogWindow w = window(lane, n_started, key);
    OTED_CHECK(simulator_->SetStateFromLog(lane, dataset_.observations.row(w.begin), HistoryBefore(dataset_, w)));
    for (int i = std::max(w.episode_begin, w.begin - config_.n_past_actions); i < w.begin; ++i) {
      before.Push(dataset_.actions.row(i));
    }
  } else {
    Rng rng = StartKey(lane, key).Stage("reset").Index(static_cast<uint64_t>(n_started)).MakeRng();
    simulator_->Reset(lane, rng);
  }
}

std::vector<LaneExperience> ExperienceGatherer::Gather(const std::vector<std::vector<double>>& z, RngKey key) {
  const size_t n_lanes = z.size();
  OTED_CHECK(static_cast<int>(n_lanes) <= simulator_->n_lanes());
  const size_t obs_dim = static_cast<size_t>(simulator_->spec().obs_dim());
  const size_t act_dim = static_cast<size_t>(simulator_->spec().act_dim);
  std::vector<LaneExperience> experience(n_lanes);
  std::vector<int> lanes(n_lanes), n_started(n_lanes, 0), step_in_rollout(n_lanes, 0);
  std::iota(lanes.begin(), lanes.end(), 0);
  std::vector<double> observations(n_lanes * obs_dim), actions(n_lanes * act_dim), row;
  std::unique_ptr<PolicyActor> actor;
  if (!config_.replayed_actions) actor = clone_->MakeActor(ActionNoise::kSampled, config_.clone_noise);

  for (const int lane : lanes) {
    simulator_->SetParameters(lane, z[static_cast<size_t>(lane)]);
    StartRollout(lane, n_started[static_cast<size_t>(lane)]++, key);
  }
  for (int t = 0; t < config_.n_steps; ++t) {
    for (size_t k = 0; k < n_lanes; ++k) {
      const auto observation = simulator_->observation(lanes[k]);
      std::copy(observation.begin(), observation.end(), observations.begin() + static_cast<ptrdiff_t>(k * obs_dim));
    }
    if (actor) {
      actor->Act(observations, static_cast<int>(n_lanes), ActionStreams(std::span(noise_).first(n_lanes)), actions);
    } else {
      for (size_t k = 0; k < n_lanes; ++k) {
        const auto action = dataset_.actions.row(window(lanes[k], n_started[k] - 1, key).begin + step_in_rollout[k]);
        std::copy(action.begin(), action.end(), actions.begin() + static_cast<ptrdiff_t>(k * act_dim));
      }
    }
    simulator_->Step(lanes, actions);
    for (size_t k = 0; k < n_lanes; ++k) {
      const LaneStatus status = simulator_->status(lanes[k]);
      const std::span<const double> action(actions.data() + k * act_dim, act_dim);
      if (status == LaneStatus::kDiverged) {
        experience[k].diverged = true;
      } else {
        AppendFeatures({observations.data() + k * obs_dim, obs_dim}, action, simulator_->observation(lanes[k]), config_,
                       past_actions_[k], row);
        stacks_[k].Push(row, experience[k].features);
        if (config_.keep_steps) {
          Dataset& steps = experience[k].steps;
          steps.observations.AppendRow({observations.data() + k * obs_dim, obs_dim});
          steps.actions.AppendRow(action);
          steps.next_observations.AppendRow(simulator_->observation(lanes[k]));
          steps.terminals.push_back(0);
          steps.timeouts.push_back(0);
        }
      }
      past_actions_[k].Push(action);
      ++step_in_rollout[k];
      const int length = RolloutLength(lanes[k], n_started[k] - 1, key);
      const bool ended = status == LaneStatus::kDiverged || step_in_rollout[k] >= length ||
                         (!config_.replayed_actions && status != LaneStatus::kRunning);
      if (ended) {
        // Whatever ended it: to those who learn from the steps the next one belongs to another rollout.
        if (!experience[k].steps.timeouts.empty()) experience[k].steps.timeouts.back() = 1;
        StartRollout(lanes[k], n_started[k]++, key);
        step_in_rollout[k] = 0;
      }
    }
  }
  return experience;
}

}  // namespace oted
