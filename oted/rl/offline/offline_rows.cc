#include "oted/rl/offline/offline_rows.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {

double ToUnitAction(const SimulatorSpec& spec, double action, int dimension) {
  const double low = spec.action_low[static_cast<size_t>(dimension)],
               high = spec.action_high[static_cast<size_t>(dimension)];
  return std::clamp((2 * action - low - high) / (high - low), -1.0, 1.0);
}

void CheckHasRewards(const Dataset& dataset) {
  if (!dataset.rewards.empty()) return;
  throw DataError(
      fmt::format("dataset '{}' has no rewards, which td3_bc, rebrac, f_brc and mbop learn from; name logs with a "
                  "column of rewards, or take these out of baselines.run",
                  dataset.path));
}

OfflineRows::OfflineRows(const Dataset& dataset, const SimulatorSpec& spec, const Normalizer& normalizer,
                         OfflineRowChoice choice, const std::vector<int>& among)
    : obs_dim_(static_cast<size_t>(dataset.obs_dim())),
      act_dim_(static_cast<size_t>(dataset.act_dim())),
      row_(2 * obs_dim_ + 2 * act_dim_ + 2) {
  CheckHasRewards(dataset);
  std::vector<uint8_t> chosen(static_cast<size_t>(dataset.size()), among.empty());
  for (const int i : among) chosen[static_cast<size_t>(i)] = 1;
  std::vector<float> observation(obs_dim_);
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i < episode.end; ++i) {
      const bool terminal = dataset.terminals[static_cast<size_t>(i)] != 0, has_next = i + 1 < episode.end;
      if (!chosen[static_cast<size_t>(i)]) continue;
      if (choice == OfflineRowChoice::kWithNextAction && !has_next && !terminal) continue;
      const auto add_observation = [&](std::span<const double> raw) {
        normalizer.Apply(raw, observation);
        rows_.insert(rows_.end(), observation.begin(), observation.end());
      };
      const auto add_action = [&](int row) {
        for (int j = 0; j < dataset.act_dim(); ++j) {
          rows_.push_back(static_cast<float>(row < 0 ? 0 : ToUnitAction(spec, dataset.actions(row, j), j)));
        }
      };
      add_observation(dataset.observations.row(i));
      add_action(i);
      add_observation(dataset.next_observations.row(i));
      rows_.push_back(static_cast<float>(dataset.rewards[static_cast<size_t>(i)]));
      rows_.push_back(terminal ? 1.0f : 0.0f);
      add_action(has_next && !terminal ? i + 1 : -1);
    }
  }
  if (rows_.empty()) {
    throw DataError(
        fmt::format("every episode of dataset '{}' has one transition, after which nothing was logged: "
                    "there is nothing to learn from offline",
                    dataset.path));
  }
}

void OfflineRows::Draw(int batch_size, Rng& rng, OfflineBatch& batch) const {
  const size_t n = static_cast<size_t>(batch_size);
  batch.size = batch_size;
  batch.observations.resize(2 * n * obs_dim_);
  batch.joint.resize(n * (obs_dim_ + act_dim_));
  batch.rewards.resize(n);
  batch.terminated.resize(n);
  batch.next_actions.resize(n * act_dim_);
  batch.noise.resize(2 * n * act_dim_);
  for (size_t b = 0; b < n; ++b) {
    const float* row = rows_.data() + rng.Below(static_cast<uint64_t>(size())) * row_;
    std::copy_n(row, obs_dim_, batch.observations.data() + b * obs_dim_);
    std::copy_n(row, obs_dim_ + act_dim_, batch.joint.data() + b * (obs_dim_ + act_dim_));
    row += obs_dim_ + act_dim_;
    std::copy_n(row, obs_dim_, batch.observations.data() + (n + b) * obs_dim_);
    row += obs_dim_;
    batch.rewards[b] = row[0];
    batch.terminated[b] = row[1];
    std::copy_n(row + 2, act_dim_, batch.next_actions.data() + b * act_dim_);
  }
  rng.FillNormal({batch.noise.data(), batch.noise.size()});
}

}  // namespace oted
