#pragma once
/// The tanh-Gaussian policy of SAC (Haarnoja et al. 2018, Appendix C), for agents and clones alike:
///   u ~ N(mean(s), exp(log_std(s))^2),   a = center + half_range tanh(u).

#include <filesystem>
#include <span>
#include <vector>

#include "oted/data/normalizer.h"
#include "oted/data/npz.h"
#include "oted/nn/mlp.h"
#include "oted/nn/policy.h"

namespace oted {

/// Bounds of the network's log standard deviation: SAC's, as in Stable-Baselines3.
inline constexpr float kLogStdMin = -20.0f;
inline constexpr float kLogStdMax = 2.0f;

/// A policy with its observation normaliser and action scaling inside: raw observations in, raw actions out.
class TanhGaussianPolicy : public Policy {
 public:
  TanhGaussianPolicy() = default;
  TanhGaussianPolicy(Normalizer normalizer, const std::vector<int>& hidden, std::vector<double> action_low,
                     std::vector<double> action_high);

  int obs_dim() const override { return net_.in(); }
  int act_dim() const override { return net_.out() / 2; }
  std::unique_ptr<PolicyActor> MakeActor(ActionNoise noise, double noise_scale = 1.0) const override;
  /// obs (normalised) -> [mean | log_std] of u, (2 act_dim).
  Mlp& net() { return net_; }
  const Mlp& net() const { return net_; }
  const Normalizer& normalizer() const { return normalizer_; }
  const std::vector<double>& action_low() const { return low_; }
  const std::vector<double>& action_high() const { return high_; }

  /// (n, obs_dim) raw -> normalised floats.
  void NormalizeObservations(std::span<const double> observations, std::span<float> out) const;
  /// a of one u, per action dimension, and back (clipped just inside the open interval).
  double SquashAction(double u, int dim) const;
  double UnsquashAction(double a, int dim) const;

  void Save(const std::filesystem::path& path) const override;
  static TanhGaussianPolicy Load(const std::filesystem::path& path);
  /// What was read from `path`. @throws DataError
  static TanhGaussianPolicy FromArrays(const NpzArrays& arrays, const std::filesystem::path& path);

 private:
  Normalizer normalizer_;
  Mlp net_;
  std::vector<double> low_, high_;
};

/// Evaluates a policy on batches of lanes; owns the scratch memory. One per thread.
class PolicyRunner : public PolicyActor {
 public:
  /// @param noise_scale multiplies the standard deviation when sampling: 1 is the policy itself.
  explicit PolicyRunner(const TanhGaussianPolicy& policy, ActionNoise noise, double noise_scale = 1.0)
      : policy_(&policy), noise_(noise), noise_scale_(noise_scale) {}
  /// observations (n, obs_dim) -> actions (n, act_dim).
  void Act(std::span<const double> observations, int n, ActionStreams streams, std::span<double> actions) override;

 private:
  const TanhGaussianPolicy* policy_;
  ActionNoise noise_;
  double noise_scale_;
  MlpPass pass_;
  AlignedVector<float> input_;
};

}  // namespace oted
