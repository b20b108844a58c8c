#include "oted/stages/design/images/ratio_estimator.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/categorical.h"

namespace oted {
namespace {

constexpr int kRowsAtOnce = 256;  // what a batch of images and their patches leaves of the cache
constexpr int kMostDegrees = 6, kMostTerms = 70;

/// Appends every row of degrees whose sum is at most `left`.
void AddDegrees(int d, int left, std::vector<int>& begun, std::vector<std::vector<int>>& all) {
  if (static_cast<int>(begun.size()) == d) {
    all.push_back(begun);
    return;
  }
  for (int degree = 0; degree <= left; ++degree) {
    begun.push_back(degree);
    AddDegrees(d, left - degree, begun, all);
    begun.pop_back();
  }
}

/// The terms of the highest total degree up to 6 that has at most 70 of them (and of 2 where none has). A constant
/// tells nothing about z and is left out.
std::vector<std::vector<int>> Degrees(int d) {
  std::vector<std::vector<int>> best;
  for (int total = 2; total <= kMostDegrees; ++total) {
    std::vector<std::vector<int>> all;
    std::vector<int> begun;
    AddDegrees(d, total, begun, all);
    all.erase(all.begin());
    if (!best.empty() && static_cast<int>(all.size()) > kMostTerms) break;
    best = std::move(all);
  }
  return best;
}

}  // namespace

RatioEstimator::RatioEstimator(const Array2<double>& rows, const InputShape& shape, int d, const RatioOptions& options,
                               Rng& init)
    : options_(options), degrees_(Degrees(d)) {
  f_ = FeatureNet(rows, shape, options.size, width());
  f_.Initialize(init);
  adam_ = Adam(f_.n_parameters(), {.learning_rate = static_cast<float>(options.learning_rate)});
}

Array2<float> RatioEstimator::Phi(const Array2<double>& u) const {
  const int d = u.cols();
  Array2<float> phi(u.rows(), width());
  std::vector<std::array<double, kMostDegrees + 1>> legendre(static_cast<size_t>(d));
  for (int k = 0; k < u.rows(); ++k) {
    for (int i = 0; i < d; ++i) {
      auto& p = legendre[static_cast<size_t>(i)];
      const double x = 2 * u(k, i) - 1;
      p[0] = 1;
      p[1] = x;
      for (int n = 1; n < kMostDegrees; ++n) {
        const auto at = static_cast<size_t>(n);
        p[at + 1] = ((2 * n + 1) * x * p[at] - n * p[at - 1]) / (n + 1);
      }
      // Orthonormal for z uniform: all coefficients are learned at one pace.
      for (int n = 0; n <= kMostDegrees; ++n) p[static_cast<size_t>(n)] *= std::sqrt(2.0 * n + 1);
    }
    for (int j = 0; j < width(); ++j) {
      double product = 1;
      for (int i = 0; i < d; ++i) {
        product *= legendre[static_cast<size_t>(i)]
                           [static_cast<size_t>(degrees_[static_cast<size_t>(j)][static_cast<size_t>(i)])];
      }
      phi(k, j) = static_cast<float>(product);
    }
  }
  return phi;
}

double RatioEstimator::Step(std::span<const std::span<const double>> samples, std::span<const int> of,
                            const Array2<double>& u) {
  const int n = static_cast<int>(samples.size()), n_z = u.rows(), m = width();
  OTED_CHECK(n > 0 && samples.size() == of.size());
  pass_.Reserve(f_, n);
  for (int i = 0; i < n; ++i) pass_.Encode(f_, samples[static_cast<size_t>(i)], i);
  const float* f = pass_.Forward(f_);
  const Array2<float> phi = Phi(u);

  // g(x_i, z_k) for all pairs, and the loss's gradient at each.
  std::vector<float> g(static_cast<size_t>(n) * static_cast<size_t>(n_z)), dg(g.size());
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n_z; ++k) {
      float product = 0;
      for (int j = 0; j < m; ++j) product += f[i * m + j] * phi(k, j);
      g[static_cast<size_t>(i * n_z + k)] = product;
    }
  }
  const double loss = CategoricalLoss(g, n_z, of, dg);
  AlignedVector<float> df(static_cast<size_t>(n * m)), gradient(f_.n_parameters());
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n_z; ++k) {
      const float d = dg[static_cast<size_t>(i * n_z + k)];
      for (int j = 0; j < m; ++j) df[static_cast<size_t>(i * m + j)] += d * phi(k, j);
    }
  }
  pass_.Backward(f_, df.data(), gradient.data());

  // Steps that shrink to nothing end at the mean of what noisy ones wander about.
  const double left = std::max(0.0, 1.0 - static_cast<double>(n_done_++) / options_.n_steps);
  adam_.set_learning_rate(static_cast<float>(options_.learning_rate * left));
  adam_.Step({f_.parameters().data(), f_.n_parameters()}, {gradient.data(), gradient.size()});
  return loss;
}

Array2<double> RatioEstimator::Features(const Array2<double>& samples) {
  const int m = width();
  Array2<double> features(samples.rows(), m);
  for (int first = 0; first < samples.rows(); first += kRowsAtOnce) {
    const int n = std::min(kRowsAtOnce, samples.rows() - first);
    pass_.Reserve(f_, n);
    for (int i = 0; i < n; ++i) pass_.Encode(f_, samples.row(first + i), i);
    const float* f = pass_.Forward(f_);
    std::copy_n(f, n * m, features.row(first).data());
  }
  return features;
}

Array2<double> RatioEstimator::LogRatios(const Array2<double>& features, const Array2<double>& u) const {
  const Array2<float> phi = Phi(u);
  Array2<double> ratios(features.rows(), u.rows());
  for (int i = 0; i < features.rows(); ++i) {
    for (int k = 0; k < u.rows(); ++k) {
      for (int j = 0; j < width(); ++j) ratios(i, k) += features(i, j) * static_cast<double>(phi(k, j));
    }
  }
  return ratios;
}

std::vector<double> RatioEstimator::LogLikelihoods(const Array2<double>& features, const Array2<double>& u) const {
  Array2<double> sum(1, width());
  for (int i = 0; i < features.rows(); ++i) {
    for (int j = 0; j < width(); ++j) sum(0, j) += features(i, j);
  }
  const Array2<double> ratios = LogRatios(sum, u);
  return {ratios.row(0).begin(), ratios.row(0).end()};
}

}  // namespace oted
