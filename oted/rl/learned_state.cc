#include "oted/rl/learned_state.h"

#include <algorithm>

#include "oted/rl/training.h"

namespace oted {

void LearnedState::Add(const std::string& name, AlignedVector<float>& parameters, Adam& adam) {
  Add(name + "/parameters", parameters);
  Add(name + "/m", adam.m());
  Add(name + "/v", adam.v());
  optimisers_.push_back(&adam);
}

void LearnedState::Save(NpzArrays& arrays) const {
  for (const auto& [name, values] : values_) {
    arrays[name] = NpyArray(std::vector<float>(values->begin(), values->end()));
  }
  std::vector<int64_t> n_steps;
  for (Adam* adam : optimisers_) n_steps.push_back(adam->n_steps());
  arrays[prefix_ + "n_steps"] = NpyArray(n_steps);
}

void LearnedState::Restore(const NpzArrays& arrays) const {
  for (const auto& [name, values] : values_) {
    std::ranges::copy(CheckpointValues<float>(arrays, name, values->size()), values->begin());
  }
  const auto& n_steps = CheckpointValues<int64_t>(arrays, prefix_ + "n_steps", optimisers_.size());
  for (size_t i = 0; i < optimisers_.size(); ++i) optimisers_[i]->n_steps() = n_steps[i];
}

}  // namespace oted
