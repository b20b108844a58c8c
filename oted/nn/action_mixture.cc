#include "oted/nn/action_mixture.h"

#include <algorithm>
#include <cmath>

#include "oted/nn/tanh_gaussian.h"

namespace oted {
namespace {

constexpr double kHalfLogTwoPi = 0.91893853320467274;

/// The largest |u| of an action, atanh(1 - kMixtureMargin).
const double kLargestU = std::atanh(1 - kMixtureMargin);

bool IsClamped(double log_std) { return !(log_std >= kLogStdMin && log_std <= kLogStdMax); }

double StdOf(double log_std) {
  return std::exp(std::clamp(log_std, static_cast<double>(kLogStdMin), static_cast<double>(kLogStdMax)));
}

/// log of sum exp, and the terms' shares in it.
double LogSumExp(const ActionMixture::Values& terms, ActionMixture::Values& shares) {
  const double largest = *std::ranges::max_element(terms);
  double sum = 0;
  for (size_t k = 0; k < terms.size(); ++k) sum += shares[k] = std::exp(terms[k] - largest);
  for (double& share : shares) share /= sum;
  return largest + std::log(sum);
}

/// The density at a = tanh(u), |u| <= kLargestU; gradient->action is d log mu / d u.
double LogDensityAt(const ActionMixture& mixture, double u, ActionMixtureGradient* gradient) {
  ActionMixture::Values weights, terms, responsibilities, z, stds;
  const double log_normaliser = LogSumExp(mixture.logits, weights);
  for (size_t k = 0; k < terms.size(); ++k) {
    stds[k] = StdOf(mixture.log_stds[k]);
    z[k] = (u - mixture.means[k]) / stds[k];
    terms[k] = mixture.logits[k] - 0.5 * z[k] * z[k] - std::log(stds[k]) - kHalfLogTwoPi;
  }
  const double action = std::tanh(u);
  const double log_density =
      LogSumExp(terms, responsibilities) - log_normaliser - std::log((1 - action) * (1 + action));
  if (gradient == nullptr) return log_density;
  gradient->action = 2 * action;
  for (size_t k = 0; k < terms.size(); ++k) {
    const double r = responsibilities[k];
    gradient->logits[k] = r - weights[k];
    gradient->means[k] = r * z[k] / stds[k];
    gradient->log_stds[k] = IsClamped(mixture.log_stds[k]) ? 0 : r * (z[k] * z[k] - 1);
    gradient->action -= r * z[k] / stds[k];
  }
  return log_density;
}

}  // namespace

double LogDensity(const ActionMixture& mixture, double action, ActionMixtureGradient* gradient) {
  const double largest = 1 - kMixtureMargin, clipped = std::clamp(action, -largest, largest);
  const double log_density = LogDensityAt(mixture, std::atanh(clipped), gradient);
  if (gradient != nullptr) {
    gradient->action = clipped == action ? gradient->action / ((1 - clipped) * (1 + clipped)) : 0;
  }
  return log_density;
}

MixtureDraw Draw(const ActionMixture& mixture, double uniform, double noise) {
  ActionMixture::Values weights;
  LogSumExp(mixture.logits, weights);
  MixtureDraw draw;
  for (double sum = weights[0]; draw.component + 1 < kMixtureComponents && uniform >= sum;) {
    sum += weights[static_cast<size_t>(++draw.component)];
  }
  const size_t k = static_cast<size_t>(draw.component);
  draw.u = std::clamp(mixture.means[k] + StdOf(mixture.log_stds[k]) * noise, -kLargestU, kLargestU);
  draw.action = std::tanh(draw.u);
  return draw;
}

double LogDensityOfDraw(const ActionMixture& mixture, const MixtureDraw& draw, double noise,
                        ActionMixtureGradient* gradient) {
  const double log_density = LogDensityAt(mixture, draw.u, gradient);
  if (gradient == nullptr || std::abs(draw.u) == kLargestU) return log_density;
  const size_t k = static_cast<size_t>(draw.component);
  gradient->means[k] += gradient->action;
  if (!IsClamped(mixture.log_stds[k])) {
    gradient->log_stds[k] += gradient->action * StdOf(mixture.log_stds[k]) * noise;
  }
  return log_density;
}

ActionMixture MixtureOf(std::span<const float> out, int dimension, int act_dim) {
  const size_t block = static_cast<size_t>(act_dim * kMixtureComponents);
  const float* from = out.data() + static_cast<size_t>(dimension * kMixtureComponents);
  ActionMixture mixture;
  std::copy_n(from, kMixtureComponents, mixture.logits.begin());
  std::copy_n(from + block, kMixtureComponents, mixture.means.begin());
  std::copy_n(from + 2 * block, kMixtureComponents, mixture.log_stds.begin());
  return mixture;
}

void AddMixtureGradient(const ActionMixture& gradient, double weight, int dimension, int act_dim,
                        std::span<float> dout) {
  const size_t block = static_cast<size_t>(act_dim * kMixtureComponents);
  float* to = dout.data() + static_cast<size_t>(dimension * kMixtureComponents);
  for (const auto* values : {&gradient.logits, &gradient.means, &gradient.log_stds}) {
    for (size_t k = 0; k < values->size(); ++k) to[k] += static_cast<float>(weight * (*values)[k]);
    to += block;
  }
}

void LogDensities(std::span<const float> out, const float* actions, size_t stride, int act_dim,
                  std::vector<double>& log_density, std::span<double> d_actions) {
  const size_t width = 3 * static_cast<size_t>(act_dim * kMixtureComponents), rows = out.size() / width;
  log_density.assign(rows, 0);
  ActionMixtureGradient gradient;
  for (size_t b = 0; b < rows; ++b) {
    for (int j = 0; j < act_dim; ++j) {
      const ActionMixture mixture = MixtureOf(out.subspan(b * width, width), j, act_dim);
      const double action = actions[b * stride + static_cast<size_t>(j)];
      log_density[b] += LogDensity(mixture, action, d_actions.empty() ? nullptr : &gradient);
      if (!d_actions.empty()) d_actions[b * static_cast<size_t>(act_dim) + static_cast<size_t>(j)] = gradient.action;
    }
  }
}

}  // namespace oted
