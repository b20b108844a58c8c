#include "oted/sim/channels.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "oted/base/error.h"

namespace oted {
namespace {

/// A delay as whole control steps and the rest.
struct Age {
  int whole;
  double fraction;
  explicit Age(double delay) : whole(static_cast<int>(std::floor(delay))), fraction(delay - std::floor(delay)) {}
};

/// The noise that follows an observation: a function of the observation alone.
Rng NoiseAfter(std::span<const double> observation) {
  RngKey key = RngKey(0).Stage("noise after a set state");
  for (const double value : observation) key = key.Index(std::bit_cast<uint64_t>(value));
  return key.MakeRng();
}

}  // namespace

std::vector<double> ChannelSetup::PlantParameters(std::span<const double> z) const {
  std::vector<double> values;
  for (const int i : to_plant) values.push_back(z[static_cast<size_t>(i)]);
  return values;
}

// ---------------------------------------------------------------- memory

void ChannelSimulator::Memory::Resize(int n_rows, int width) {
  n_rows_ = n_rows;
  width_ = width;
  head_ = 0;
  values_.assign(static_cast<size_t>(n_rows) * static_cast<size_t>(width), 0.0);
}

void ChannelSimulator::Memory::Fill(std::span<const double> row) {
  for (int i = 0; i < n_rows_; ++i) Push(row);
}

void ChannelSimulator::Memory::Push(std::span<const double> row) {
  head_ = (head_ + 1) % n_rows_;
  std::copy(row.begin(), row.end(), values_.begin() + static_cast<ptrdiff_t>(head_) * width_);
}

std::span<const double> ChannelSimulator::Memory::Back(int age) const {
  const int row = (head_ + n_rows_ - age) % n_rows_;
  return {values_.data() + static_cast<ptrdiff_t>(row) * width_, static_cast<size_t>(width_)};
}

// ---------------------------------------------------------------- simulator

ChannelSimulator::ChannelSimulator(std::shared_ptr<const ChannelSetup> setup, std::unique_ptr<Simulator> plant)
    : WrappedSimulator(std::move(plant)), setup_(std::move(setup)) {
  const SimulatorSpec& spec = setup_->spec;
  const size_t obs_dim = static_cast<size_t>(spec.obs_dim());
  for (size_t k = 0; k < static_cast<size_t>(spec.act_dim); ++k) {
    neutral_.push_back(spec.n_discrete_actions > 0 ? 0.0 : std::clamp(0.0, spec.action_low[k], spec.action_high[k]));
  }
  lanes_.resize(static_cast<size_t>(n_lanes()));
  for (Lane& lane : lanes_) {
    lane.action_delay.assign(neutral_.size(), 0.0);
    lane.noise_std.assign(obs_dim, 0.0);
    lane.bias = lane.delay = lane.shown = lane.noise_std;
    lane.scale.assign(obs_dim, 1.0);
    lane.actions.Resize(setup_->longest_action_delay + 1, spec.act_dim);
    lane.observations.Resize(setup_->longest_observation_delay + 1, spec.obs_dim());
  }
  actions_.resize(lanes_.size() * neutral_.size());
  before_.resize(actions_.size());
  late_share_.resize(actions_.size());
}

void ChannelSimulator::SetParameters(int lane, std::span<const double> z) {
  setup_->space.CheckInside(z);
  inside().SetParameters(lane, setup_->PlantParameters(z));
  Lane& l = At(lane);
  for (const auto& [index, field] : setup_->channels) {
    const double value = z[static_cast<size_t>(index)];
    for (const int channel : field.channels) {
      const size_t j = static_cast<size_t>(channel);
      if (field.quantity == ChannelQuantity::kActionDelay) l.action_delay[j] = value;
      if (field.quantity == ChannelQuantity::kNoiseStd) l.noise_std[j] = value;
      if (field.quantity == ChannelQuantity::kBias) l.bias[j] = value;
      if (field.quantity == ChannelQuantity::kScale) l.scale[j] = value;
      if (field.quantity == ChannelQuantity::kObservationDelay) l.delay[j] = value;
    }
  }
}

void ChannelSimulator::Begin(Lane& lane, Rng noise) {
  lane.noise = noise;
  lane.clock = 0;
  lane.n_ahead = 0;
  lane.actions.Fill(neutral_);
}

void ChannelSimulator::Reset(int lane, Rng& rng) {
  inside().Reset(lane, rng);
  BeginAtPlant(lane, rng);
}

void ChannelSimulator::ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng) {
  inside().ResetTo(lane, qpos, qvel, rng);
  BeginAtPlant(lane, rng);
}

void ChannelSimulator::BeginAtPlant(int lane, Rng& rng) {
  // One draw where there is noise; none otherwise, so that the caller's stream goes on as without this class.
  Begin(At(lane), setup_->n_noisy > 0 ? RngKey(rng.Next()).Stage("noise").MakeRng() : Rng(0));
  At(lane).observations.Fill(inside().observation(lane));
  Show(lane);
}

bool ChannelSimulator::SetStateFromObservation(int lane, std::span<const double> observation) {
  return SetStateFromLog(lane, observation, {});
}

bool ChannelSimulator::SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) {
  const size_t obs_dim = static_cast<size_t>(spec().obs_dim());
  // The plant says what is wrong with either.
  if (!spec().can_set_state || observation.size() != obs_dim)
    return inside().SetStateFromObservation(lane, observation);
  const int n_before = static_cast<int>(before.observations.size() / obs_dim);
  OTED_CHECK(before.observations.size() == static_cast<size_t>(n_before) * obs_dim);
  OTED_CHECK(before.actions.size() == static_cast<size_t>(n_before) * neutral_.size());
  const std::vector<double>& delay = At(lane).delay;
  const int n_back = std::min(static_cast<int>(std::ceil(*std::max_element(delay.begin(), delay.end()))), n_before);
  return StartBack(lane, observation, before, n_back, true) || StartBack(lane, observation, before, 0, true) ||
         StartBack(lane, observation, before, 0, false);
}

bool ChannelSimulator::SetState(int lane, std::span<const double> state, const LoggedHistory& before) {
  Lane& l = At(lane);
  const size_t obs_dim = l.bias.size();
  if (state.size() != obs_dim + spec().hidden.size()) return inside().SetState(lane, state, {});  // says what is wrong
  std::vector<double> of_plant(state.begin(), state.end());
  for (size_t j = 0; j < obs_dim; ++j) of_plant[j] = l.True(j, of_plant[j]);
  const int n_before = static_cast<int>(before.actions.size() / neutral_.size());
  if (!inside().SetState(lane, of_plant, OfPlant(l, before, n_before))) return false;
  Begin(l, NoiseAfter(state));
  l.observations.Fill(inside().observation(lane));
  FillActions(l, before, n_before);
  l.shown.assign(state.begin(), state.begin() + static_cast<ptrdiff_t>(obs_dim));
  return true;
}

/// The actions that were given before row `end` of the history, as far back as a delay reaches.
void ChannelSimulator::FillActions(Lane& lane, const LoggedHistory& before, int end) const {
  const size_t act_dim = neutral_.size();
  for (int row = std::max(0, end - setup_->longest_action_delay); row < end; ++row) {
    lane.actions.Push(before.actions.subspan(static_cast<size_t>(row) * act_dim, act_dim));
  }
}

LoggedHistory ChannelSimulator::OfPlant(const Lane& lane, const LoggedHistory& before, int end) {
  if (spec().n_rows_before == 0) return {};
  const size_t act_dim = neutral_.size(), n = static_cast<size_t>(end);
  const LoggedHistory given = {before.observations.first(n * static_cast<size_t>(spec().obs_dim())),
                               before.actions.first(n * act_dim), before.constants};
  const bool prompt = std::ranges::all_of(lane.action_delay, [](double delay) { return delay == 0; });
  if (prompt || setup_->spec.n_discrete_actions > 0) return given;
  const auto was_given = [&](int row, size_t k) {
    return row < 0 ? neutral_[k] : given.actions[static_cast<size_t>(row) * act_dim + k];
  };
  late_history_.resize(given.actions.size());
  for (int row = 0; row < end; ++row) {
    for (size_t k = 0; k < act_dim; ++k) {
      const Age age(lane.action_delay[k]);
      late_history_[static_cast<size_t>(row) * act_dim + k] =
          spec().MeanAction(k, was_given(row - age.whole - 1, k), was_given(row - age.whole, k), age.fraction);
    }
  }
  return {given.observations, late_history_, given.constants};
}

std::optional<bool> ChannelSimulator::EndsAt(int lane, std::span<const double> observation) {
  if (!SetStateFromObservation(lane, observation)) return std::nullopt;
  // A copy: the plant writes the rows that it shows.
  const std::span<const double> state = inside().observation(lane);
  return inside().EndsAt(lane, std::vector<double>(state.begin(), state.end()));
}

bool ChannelSimulator::StartBack(int lane, std::span<const double> observation, const LoggedHistory& before, int n_back,
                                 bool corrected) {
  Lane& l = At(lane);
  const size_t obs_dim = observation.size(), act_dim = neutral_.size();
  const int n_before = static_cast<int>(before.observations.size() / obs_dim);
  const int start = n_before - n_back;
  const auto logged = [&](int row, size_t j) {
    return row >= n_before ? observation[j] : before.observations[static_cast<size_t>(row) * obs_dim + j];
  };
  const auto action = [&](int row) { return before.actions.subspan(static_cast<size_t>(row) * act_dim, act_dim); };

  // The state that the plant had at row `start`: sensor j has shown it delay[j] rows later. Where that lies beyond the
  // present, the episode began at `start`, and its first readings are of its start.
  std::vector<double> state(obs_dim);
  for (size_t j = 0; j < obs_dim; ++j) {
    const Age age(l.delay[j] <= n_back ? l.delay[j] : 0.0);
    const int row = start + age.whole;
    state[j] = logged(row, j);
    if (age.fraction > 0) state[j] += age.fraction * (logged(row + 1, j) - state[j]);
    if (corrected) state[j] = l.True(j, state[j]);
  }
  if (!inside().SetStateFromLog(lane, state, OfPlant(l, before, start))) return false;

  Begin(l, NoiseAfter(observation));
  l.observations.Fill(inside().observation(lane));
  FillActions(l, before, start);
  for (int row = start; row < n_before && inside().status(lane) != LaneStatus::kDiverged; ++row) {
    PushAction(lane, action(row));
    StepPlant({&lane, 1});
    l.observations.Push(inside().observation(lane));
    ++l.n_ahead;
  }
  l.shown.assign(observation.begin(), observation.end());
  return true;
}

void ChannelSimulator::PushAction(int lane, std::span<const double> action) {
  Lane& l = At(lane);
  l.actions.Push(action);
  const bool discrete = setup_->spec.n_discrete_actions > 0;
  for (size_t k = 0; k < neutral_.size(); ++k) {
    const Age age(discrete ? std::round(l.action_delay[k]) : l.action_delay[k]);
    const size_t i = static_cast<size_t>(lane) * neutral_.size() + k;
    actions_[i] = l.actions.Back(age.whole)[k];
    if (age.fraction > 0) before_[i] = l.actions.Back(age.whole + 1)[k];
    late_share_[i] = age.fraction;
  }
}

void ChannelSimulator::StepPlant(std::span<const int> lanes) {
  const size_t act_dim = neutral_.size();
  const auto is_late = [&](int lane) {
    const auto shares = std::span<const double>(late_share_).subspan(static_cast<size_t>(lane) * act_dim, act_dim);
    return std::ranges::any_of(shares, [](double share) { return share > 0; });
  };
  if (std::ranges::any_of(lanes, is_late)) {
    inside().StepLate(lanes, actions_, {.before = before_, .share = late_share_});
  } else {
    inside().Step(lanes, actions_);
  }
}

void ChannelSimulator::Step(std::span<const int> lanes, std::span<const double> actions) {
  const size_t act_dim = neutral_.size();
  OTED_CHECK(actions.size() == actions_.size());
  for (const int lane : lanes) {
    const auto action = actions.subspan(static_cast<size_t>(lane) * act_dim, act_dim);
    // It would reach the plant some steps later, where nobody could say whose it was.
    if (!std::all_of(action.begin(), action.end(), [](double a) { return std::isfinite(a); })) {
      throw UsageError(
          fmt::format("lane {}: got an action that is not finite, wanted {} finite numbers", lane, act_dim));
    }
  }
  for (const int lane : lanes) PushAction(lane, actions.subspan(static_cast<size_t>(lane) * act_dim, act_dim));
  StepPlant(lanes);
  for (const int lane : lanes) {
    ++At(lane).clock;
    At(lane).observations.Push(inside().observation(lane));
    Show(lane);
  }
}

void ChannelSimulator::Show(int lane) {
  Lane& l = At(lane);
  for (size_t j = 0; j < l.shown.size(); ++j) {
    const Age age(l.delay[j]);
    double value = l.observations.Back(age.whole)[j];
    if (age.fraction > 0) value += age.fraction * (l.observations.Back(age.whole + 1)[j] - value);
    value = l.Shown(j, value);
    if (setup_->is_noisy[j]) {
      // Drawn also where its standard deviation is 0: lanes with equal starts keep equal draws.
      const double noise = l.noise.Normal();
      if (l.noise_std[j] != 0) value += l.noise_std[j] * noise;
    }
    l.shown[j] = value;
  }
}

std::span<const double> ChannelSimulator::observation(int lane) const { return At(lane).shown; }

LaneStatus ChannelSimulator::status(int lane) const {
  const LaneStatus status = inside().status(lane);
  // The plant's clock also counts the steps that it made before the episode's start.
  const bool early = At(lane).n_ahead > 0 && At(lane).clock < spec().max_episode_steps;
  return status == LaneStatus::kTruncated && early ? LaneStatus::kRunning : status;
}

}  // namespace oted
