#include "oted/rl/imitation_rows.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "oted/base/error.h"

namespace oted {

ImitationRows::ImitationRows(const Dataset& dataset, const TanhGaussianPolicy& policy, std::vector<int> drawn)
    : obs_dim_(static_cast<size_t>(policy.obs_dim())),
      act_dim_(static_cast<size_t>(policy.act_dim())),
      drawn_(std::move(drawn)) {
  if (drawn_.empty()) {
    drawn_.resize(static_cast<size_t>(dataset.size()));
    std::iota(drawn_.begin(), drawn_.end(), 0);
  }
  const size_t n = static_cast<size_t>(dataset.size());
  states_.resize(n * obs_dim_);
  next_.resize(n * obs_dim_);
  policy.NormalizeObservations(dataset.observations.values(), states_);
  policy.NormalizeObservations(dataset.next_observations.values(), next_);
  for (int i = 0; i < dataset.size(); ++i) {
    for (size_t j = 0; j < act_dim_; ++j) {
      const double low = policy.action_low()[j], high = policy.action_high()[j];
      const double a = dataset.actions(i, static_cast<int>(j));
      actions_.push_back(static_cast<float>(std::clamp((2 * a - low - high) / (high - low), -1.0, 1.0)));
    }
  }
  last_.assign(n, 0);
  for (const Episode& episode : dataset.Episodes()) {
    starts_.push_back(episode.begin);
    last_[static_cast<size_t>(episode.end - 1)] = 1;
  }
}

const float* ImitationRows::Next(int i, Rng& rng) const {
  const auto row = static_cast<size_t>(drawn_[static_cast<size_t>(i)]);
  if (last_[row] == 0) return next_.data() + row * obs_dim_;
  return State(starts_[rng.Below(starts_.size())]);
}

void ImitationRows::Save(const std::string& prefix, NpzArrays& arrays) const {
  arrays[prefix + "/states"] = NpyArray(states_);
  arrays[prefix + "/actions"] = NpyArray(actions_);
  arrays[prefix + "/next"] = NpyArray(next_);
  arrays[prefix + "/last"] = NpyArray(std::vector<int64_t>(last_.begin(), last_.end()));
  arrays[prefix + "/drawn"] = NpyArray(std::vector<int64_t>(drawn_.begin(), drawn_.end()));
  arrays[prefix + "/starts"] = NpyArray(std::vector<int64_t>(starts_.begin(), starts_.end()));
}

ImitationRows ImitationRows::FromArrays(const std::string& prefix, const NpzArrays& arrays, const std::string& where) {
  ImitationRows rows;
  const auto read = [&]<class Value>(const char* name, std::vector<Value>& values) {
    const auto found = arrays.find(prefix + "/" + name);
    if (found == arrays.end()) {
      throw DataError("'" + where + "' has no array '" + prefix + "/" + name + "'; remove it to make it again");
    }
    for (const double v : found->second.ToDouble()) values.push_back(static_cast<Value>(v));
  };
  read("states", rows.states_);
  read("actions", rows.actions_);
  read("next", rows.next_);
  read("last", rows.last_);
  read("drawn", rows.drawn_);
  read("starts", rows.starts_);
  const size_t n = rows.last_.size();
  const auto are_rows = [&](const std::vector<int>& list) {
    return !list.empty() && std::ranges::all_of(list, [&](int i) { return i >= 0 && static_cast<size_t>(i) < n; });
  };
  const bool sound = n > 0 && rows.states_.size() % n == 0 && rows.actions_.size() % n == 0 &&
                     rows.next_.size() == rows.states_.size() && are_rows(rows.drawn_) && are_rows(rows.starts_);
  if (!sound)
    throw DataError("the arrays '" + prefix + "/...' of '" + where + "' do not fit; remove it to make it again");
  rows.obs_dim_ = rows.states_.size() / n;
  rows.act_dim_ = rows.actions_.size() / n;
  return rows;
}

}  // namespace oted
