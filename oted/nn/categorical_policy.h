#pragma once
/// A policy over discrete actions: logits of a network, whatever the observation is.

#include <filesystem>
#include <span>
#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/feature_net.h"
#include "oted/nn/policy.h"

namespace oted {

/// P(a | s) = softmax(f(s))_a. An action is its index, one number.
class CategoricalPolicy : public Policy {
 public:
  /// The array that tells a file of this kind from one of a tanh-Gaussian policy.
  static constexpr const char* kMark = "categorical/parameters";

  CategoricalPolicy() = default;
  /// The encoder is fitted on `observations`.
  CategoricalPolicy(const Array2<double>& observations, const InputShape& shape, const NetSize& size, int n_actions)
      : net_(observations, shape, size, n_actions) {}
  explicit CategoricalPolicy(FeatureNet net) : net_(std::move(net)) {}

  int obs_dim() const override { return net_.in(); }
  int act_dim() const override { return 1; }
  int n_actions() const { return net_.out(); }
  FeatureNet& net() { return net_; }
  const FeatureNet& net() const { return net_; }

  /// kMean takes the most probable action. A noise scale t draws from softmax(f / t), 0 as kMean.
  std::unique_ptr<PolicyActor> MakeActor(ActionNoise noise, double noise_scale = 1.0) const override;

  void Save(const std::filesystem::path& path) const override;
  static CategoricalPolicy Load(const std::filesystem::path& path);
  /// What was read from `path`. @throws DataError
  static CategoricalPolicy FromArrays(const NpzArrays& arrays, const std::filesystem::path& path);

 private:
  FeatureNet net_;
};

}  // namespace oted
