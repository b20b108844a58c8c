#pragma once
/// A discriminator that is told z: g(x, z) tells a sample x of M(z) from samples of the other simulators.
///
/// Trained in simulators alone by picking, for each x, the z that it came from out of a batch,
///   minimise  -log softmax_k g(x, z_k) [own z],
/// it ends at g(x, z) = log p(x | z) + c(x) (Durkan et al. 2020; Hermans et al. 2020 with two classes). Whoever acts
/// contributes the same factor to p(x | z) at every z, which c(x) absorbs: the logs need not have been made by the
/// policy that the simulators were sampled with. g(x, z) = f(x) . phi(z), so that a whole log is one vector, sum f(x).
/// phi holds polynomials in u, the place of z in the unit cube: a log likelihood is smooth, and the kinks of a network
/// in z would, summed over many samples, be its peaks.

#include <span>
#include <vector>

#include "oted/base/rng.h"
#include "oted/nn/feature_net.h"

namespace oted {

struct RatioOptions {
  NetSize size = {.hidden = {64}, .filters = {16}, .mean_pool = false};  ///< of f
  double learning_rate = 2e-3;                                           ///< falls to 0 over n_steps
  int n_steps = 2400;                                                    ///< gradient steps to come
};

class RatioEstimator {
 public:
  /// @param rows  samples that the encoder of f is fitted on. @param d  parameters
  RatioEstimator(const Array2<double>& rows, const InputShape& shape, int d, const RatioOptions& options, Rng& init);

  /// One gradient step. @param u  (n_z, d) points of the unit cube. @param of  the row of u that each sample came from
  /// @return the loss before it [nats]; log n_z when g knows nothing
  double Step(std::span<const std::span<const double>> samples, std::span<const int> of, const Array2<double>& u);

  /// (n, width): f of each sample.
  Array2<double> Features(const Array2<double>& samples);
  /// sum_x g(x, z) [nats], but for a constant, at each row of u.
  /// @param features  of the samples x
  std::vector<double> LogLikelihoods(const Array2<double>& features, const Array2<double>& u) const;
  /// (n, n_u): phi(u) . f(x) of each sample at each row of u.
  Array2<double> LogRatios(const Array2<double>& features, const Array2<double>& u) const;

 private:
  int width() const { return static_cast<int>(degrees_.size()); }
  /// (n_u, width)
  Array2<float> Phi(const Array2<double>& u) const;

  RatioOptions options_;
  FeatureNet f_;
  FeaturePass pass_;
  std::vector<std::vector<int>> degrees_;  // of each entry of phi: the degree in each coordinate
  Adam adam_;
  int n_done_ = 0;
};

}  // namespace oted
