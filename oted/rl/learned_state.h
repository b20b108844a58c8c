#pragma once
/// What a learner holds between two updates, by name: parameters, running statistics, optimisers' moments.

#include <string>
#include <utility>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/npz.h"
#include "oted/nn/mlp.h"

namespace oted {

/// Names and places; must not outlive them.
class LearnedState {
 public:
  /// @param prefix  of all names: "sac/"
  explicit LearnedState(std::string prefix) : prefix_(std::move(prefix)) {}
  void Add(const std::string& name, AlignedVector<float>& values) { values_.emplace_back(prefix_ + name, &values); }
  /// NAME/parameters and the moments NAME/m and NAME/v.
  void Add(const std::string& name, AlignedVector<float>& parameters, Adam& adam);
  /// In the order of Add; the names with their prefix.
  const std::vector<std::pair<std::string, AlignedVector<float>*>>& values() const { return values_; }
  const std::vector<Adam*>& optimisers() const { return optimisers_; }

  void Save(NpzArrays& arrays) const;
  /// @throws DataError naming the array that is missing or of another size; the caller names the file
  void Restore(const NpzArrays& arrays) const;

 private:
  std::string prefix_;
  std::vector<std::pair<std::string, AlignedVector<float>*>> values_;
  std::vector<Adam*> optimisers_;
};

}  // namespace oted
